//! iceoryx2 as it comes, to measure the bus beside: nothing of ours between the caller and its ports.
//!
//! [`PubSub`] does what upstream's own publish-subscribe benchmark does: the next sample is loaned while the answer is
//! awaited, and the payload is neither written nor read. [`Blackboard`] is its pattern without loans. [`Obituary`] is
//! its own way to hear of a death. For benches only: a cell speaks through [`Node`](crate::Node).

#![allow(unsafe_code)]

use std::fmt::Debug;
use std::mem::MaybeUninit;
use std::time::Duration;

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::reader::EntryHandle;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::writer::EntryHandleMut;
use iceoryx2::prelude::{EventId, ServiceName, SignalHandlingMode, ZeroCopySend, ipc};
use iceoryx2::sample_mut_uninit::SampleMutUninit;

use crate::Instance;

/// As large as a message of the benches.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct Payload(pub [u64; 12]);

// SAFETY: plain numbers, `repr(C)`, no pointer, no padding.
unsafe impl ZeroCopySend for Payload {}

/// What iceoryx2 refused, in its own words.
#[derive(Debug, thiserror::Error)]
#[error("iceoryx2 refuses to {what}: {cause}")]
pub struct DirectError {
    what: &'static str,
    cause: String,
}

fn refused<E: Debug>(what: &'static str) -> impl FnOnce(E) -> DirectError {
    move |cause| DirectError { what, cause: format!("{cause:?}") }
}

fn node(instance: &Instance) -> Result<Node<ipc::Service>, DirectError> {
    let builder = NodeBuilder::new().config(&instance.config()).signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create::<ipc::Service>().map_err(refused("create a node"))
}

fn name(service: &str) -> Result<ServiceName, DirectError> {
    service.try_into().map_err(refused("take that name for a service"))
}

/// A publisher of one service and a subscriber of another.
pub struct PubSub {
    loaned: Option<SampleMutUninit<ipc::Service, MaybeUninit<Payload>, ()>>,
    publisher: Publisher<ipc::Service, Payload, ()>,
    subscriber: Subscriber<ipc::Service, Payload, ()>,
    _node: Node<ipc::Service>,
}

impl PubSub {
    /// Opens both.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(instance: &Instance, out: &str, inward: &str) -> Result<Self, DirectError> {
        let node = node(instance)?;
        let service = |service: &str| {
            let builder = node.service_builder(&name(service)?).publish_subscribe::<Payload>();
            let builder = builder.max_publishers(2).max_subscribers(2).history_size(0).subscriber_max_buffer_size(1);
            builder.enable_safe_overflow(true).open_or_create().map_err(refused("open a service"))
        };
        let publisher = service(out)?.publisher_builder().max_loaned_samples(2).create();
        let subscriber = service(inward)?.subscriber_builder().create();
        Ok(Self {
            loaned: None,
            publisher: publisher.map_err(refused("create a publisher"))?,
            subscriber: subscriber.map_err(refused("create a subscriber"))?,
            _node: node,
        })
    }

    /// Maps what peers that came meanwhile have brought.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn connect(&self) -> Result<(), DirectError> {
        self.publisher.update_connections().map_err(refused("connect"))?;
        self.subscriber.update_connections().map_err(refused("connect"))
    }

    /// Sends the sample loaned before, and loans the next.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn send(&mut self) -> Result<(), DirectError> {
        let loaned = match self.loaned.take() {
            Some(loaned) => loaned,
            None => self.publisher.loan_uninit().map_err(refused("loan a sample"))?,
        };
        // SAFETY: any bits are a valid payload, and the memory is the kernel's zeros or an earlier payload.
        unsafe { loaned.assume_init() }.send().map_err(refused("send"))?;
        self.loaned = Some(self.publisher.loan_uninit().map_err(refused("loan a sample"))?);
        Ok(())
    }

    /// Whether a sample has come.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn received(&self) -> Result<bool, DirectError> {
        Ok(self.subscriber.receive().map_err(refused("receive"))?.is_some())
    }
}

/// The only entry of each blackboard.
const KEY: u64 = 0;

type Board = iceoryx2::service::port_factory::blackboard::PortFactory<ipc::Service, u64>;

/// A writer of one blackboard and a reader of another.
pub struct Blackboard {
    writer: EntryHandleMut<ipc::Service, u64, Payload>,
    reader: EntryHandle<ipc::Service, u64, Payload>,
    _node: Node<ipc::Service>,
}

impl Blackboard {
    /// Makes both blackboards, to write the first.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn create(instance: &Instance, out: &str, inward: &str) -> Result<Self, DirectError> {
        let node = node(instance)?;
        let create = |service: &str| {
            let builder = node.service_builder(&name(service)?).blackboard_creator::<u64>();
            builder.add::<Payload>(KEY, Payload::default()).create().map_err(refused("create a blackboard"))
        };
        let (out, inward) = (create(out)?, create(inward)?);
        Self::between(node, &out, &inward)
    }

    /// Opens both, which are there.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(instance: &Instance, out: &str, inward: &str) -> Result<Self, DirectError> {
        let node = node(instance)?;
        let open = |service: &str| {
            let builder = node.service_builder(&name(service)?).blackboard_opener::<u64>();
            builder.open().map_err(refused("open a blackboard"))
        };
        let (out, inward) = (open(out)?, open(inward)?);
        Self::between(node, &out, &inward)
    }

    fn between(node: Node<ipc::Service>, out: &Board, inward: &Board) -> Result<Self, DirectError> {
        let writer = out.writer_builder().create().map_err(refused("create a writer"))?;
        let reader = inward.reader_builder().create().map_err(refused("create a reader"))?;
        Ok(Self {
            writer: writer.entry(&KEY).map_err(refused("write an entry"))?,
            reader: reader.entry(&KEY).map_err(refused("read an entry"))?,
            _node: node,
        })
    }

    /// Writes a value.
    pub fn write(&self, value: Payload) {
        self.writer.update_with_copy(value);
    }

    /// The value now.
    pub fn read(&self) -> Payload {
        *self.reader.get()
    }
}

const DEAD: EventId = EventId::new(1);

/// Hears of a dead process by iceoryx2's own event: somebody has to look for dead nodes, and that one tells.
pub struct Obituary {
    listener: Listener<ipc::Service>,
    node: Node<ipc::Service>,
}

/// What a process holds whose death shall be told.
pub struct Mortal {
    _notifier: Notifier<ipc::Service>,
    _node: Node<ipc::Service>,
}

impl Obituary {
    /// Listens on a service.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(instance: &Instance, service: &str) -> Result<Self, DirectError> {
        let node = node(instance)?;
        let events = node.service_builder(&name(service)?).event().notifier_dead_event(DEAD).open_or_create();
        let listener = events.map_err(refused("open an event"))?.listener_builder().create();
        Ok(Self { listener: listener.map_err(refused("listen"))?, node })
    }

    /// Looks for dead nodes once, then waits that long for the word; whether it has come.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn heard(&self, wait: Duration) -> Result<bool, DirectError> {
        self.node.try_cleanup_dead_nodes();
        let mut heard = false;
        self.listener.timed_wait(|activation| heard |= activation.id == DEAD, wait).map_err(refused("wait"))?;
        Ok(heard)
    }
}

impl Mortal {
    /// Holds a place whose loss is told on a service.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(instance: &Instance, service: &str) -> Result<Self, DirectError> {
        let node = node(instance)?;
        let events = node.service_builder(&name(service)?).event().notifier_dead_event(DEAD).open_or_create();
        let notifier = events.map_err(refused("open an event"))?.notifier_builder().create();
        Ok(Self { _notifier: notifier.map_err(refused("be a notifier"))?, _node: node })
    }
}
