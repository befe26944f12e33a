//! One process's place on the bus.

use std::cell::OnceCell;
use std::fmt::Debug;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::node::NodeBuilder;
use iceoryx2::port::publisher::{Publisher as Port, PublisherCreateError};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{BackpressureStrategy, NodeName, SignalHandlingMode, ZeroCopySend, ipc};
use tandem_msg::{Header, Message};

use crate::channel::Channel;
use crate::link::{Claim, Link};
use crate::loan::{Borrower, Lender};
use crate::service::{BUFFER, HISTORY, Kind, Opening, until};
use crate::wire::{Wire, channel, loan};
use crate::{BusError, Instance, Intent, Latest, Publisher};

type InnerNode = iceoryx2::node::Node<ipc::Service>;

/// Who writes: goes into every header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The role's word, for messages to people.
    pub role: String,
    /// Incarnation of the process: grows each time it is started anew.
    pub epoch: u64,
    /// Hash of the cell's configuration; a service of another one is refused.
    pub config_hash: u64,
}

/// One process's place on the bus.
///
/// Channels ([`Node::publisher`], [`Node::latest`]) are kept connected by a thread
/// of their own. What is read and written in place ([`Node::lender`],
/// [`Node::borrower`]) belongs to the thread that opened it.
pub struct Node {
    joining: Joining,
    /// Started with the first channel.
    link: OnceCell<Arc<Link>>,
    /// Joins with the first loan.
    local: OnceCell<InnerNode>,
}

/// What joining the bus takes.
#[derive(Clone, Debug)]
pub(crate) struct Joining {
    pub(crate) instance: Instance,
    pub(crate) identity: Identity,
    pub(crate) deadline: Duration,
}

impl Node {
    /// A place on the bus of a cell; it joins when the first port is opened. No
    /// signal handler is installed. Whatever is opened from this node is tried again
    /// until `deadline` has passed, when the trouble may be passing.
    pub fn new(instance: &Instance, identity: Identity, deadline: Duration) -> Self {
        let joining = Joining { instance: instance.clone(), identity, deadline };
        Self { joining, link: OnceCell::new(), local: OnceCell::new() }
    }

    /// The writing end of a service's latest value.
    ///
    /// # Errors
    /// `Node`, `InvalidService`, `Service`, `Mismatch`, `WriterPort`.
    pub fn publisher<M: Message>(&self, service: &str) -> Result<Publisher<M>, BusError> {
        let (link, joining, service) = (self.link()?, self.joining.clone(), service.to_owned());
        let (port, place) = link.ask(move |desk| {
            let port = joining.writer::<Channel<M>>(&desk.node, &service, channel::<M>())?;
            desk.keep_writer(port, joining.identity.epoch).ok_or(BusError::NoMemory { service })
        })??;
        Ok(Publisher::new(place, self.joining.header(), Claim { link, port }))
    }

    /// The reading end of a service's latest value.
    ///
    /// # Errors
    /// `Node`, `InvalidService`, `Service`, `Mismatch`, `ReaderPort`.
    pub fn latest<M: Message>(&self, service: &str) -> Result<Latest<M>, BusError> {
        let (link, joining, service) = (self.link()?, self.joining.clone(), service.to_owned());
        let (port, door) = link.ask(move |desk| {
            let port = joining.reader::<Channel<M>>(&desk.node, &service, channel::<M>())?;
            Ok::<_, BusError>(desk.keep_reader(port))
        })??;
        Ok(Latest::new(door, Claim { link, port }))
    }

    /// The writing end of a service whose messages are written in place.
    ///
    /// # Errors
    /// As [`Node::publisher`].
    pub fn lender<M: Message>(&self, service: &str) -> Result<Lender<M>, BusError> {
        let port = self.joining.writer::<Wire<M>>(self.local()?, service, loan::<M>())?;
        Ok(Lender::new(port, self.joining.header()))
    }

    /// The reading end of a service whose messages are read in place.
    ///
    /// # Errors
    /// As [`Node::latest`].
    pub fn borrower<M: Message>(&self, service: &str) -> Result<Borrower<M>, BusError> {
        Ok(Borrower::new(self.joining.reader::<Wire<M>>(self.local()?, service, loan::<M>())?))
    }

    fn link(&self) -> Result<Arc<Link>, BusError> {
        match self.link.get() {
            Some(link) => Ok(Arc::clone(link)),
            None => {
                let joining = self.joining.clone();
                let link = Link::start(move || joining.node())?;
                Ok(Arc::clone(self.link.get_or_init(|| link)))
            }
        }
    }

    fn local(&self) -> Result<&InnerNode, BusError> {
        match self.local.get() {
            Some(node) => Ok(node),
            None => {
                let node = self.joining.node()?;
                Ok(self.local.get_or_init(|| node))
            }
        }
    }
}

impl Joining {
    fn node(&self) -> Result<InnerNode, BusError> {
        let config = self.instance.config();
        let name: NodeName = self.identity.role.as_str().try_into().unwrap_or_default();
        let create = || {
            NodeBuilder::new()
                .config(&config)
                .name(&name)
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .create::<ipc::Service>()
        };
        until(self.deadline, create, |_| true).map_err(|(cause, waited)| BusError::Node {
            instance: self.instance.id().to_owned(),
            root: self.instance.root().to_owned(),
            role: self.identity.role.clone(),
            waited,
            cause,
        })
    }

    fn writer<T: ZeroCopySend + Debug>(
        &self,
        node: &InnerNode,
        service: &str,
        kind: Kind,
    ) -> Result<Port<ipc::Service, T, ()>, BusError> {
        let factory = Opening { node, joining: self, service, kind }.open::<T>(Intent::Write)?;
        let create = || {
            factory
                .publisher_builder()
                .max_loaned_samples(1)
                // Overflow is on, so this never acts; the default would block.
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let passing = |cause: &PublisherCreateError| *cause == PublisherCreateError::ExceedsMaxSupportedPublishers;
        until(self.deadline, create, passing).map_err(|(cause, waited)| BusError::WriterPort {
            service: service.to_owned(),
            role: self.identity.role.clone(),
            waited,
            cause,
        })
    }

    fn reader<T: ZeroCopySend + Debug>(
        &self,
        node: &InnerNode,
        service: &str,
        kind: Kind,
    ) -> Result<Subscriber<ipc::Service, T, ()>, BusError> {
        let factory = Opening { node, joining: self, service, kind }.open::<T>(Intent::Read)?;
        let create = || factory.subscriber_builder().buffer_size(BUFFER).history_request(HISTORY).create();
        until(self.deadline, create, |_| true).map_err(|(cause, waited)| BusError::ReaderPort {
            service: service.to_owned(),
            role: self.identity.role.clone(),
            waited,
            cause,
        })
    }

    fn header(&self) -> Header {
        Header { epoch: self.identity.epoch, config_hash: self.identity.config_hash, ..Header::default() }
    }
}
