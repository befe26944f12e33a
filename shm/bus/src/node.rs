//! One process's place on the bus, and the bounded opening of services.

use std::time::{Duration, Instant};

use iceoryx2::node::NodeBuilder;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::prelude::{
    AttributeVerifier, BackpressureStrategy, MessagingPattern, NodeName, Service, ServiceName, SignalHandlingMode, ipc,
};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError as Create, PublishSubscribeOpenError as Open,
    PublishSubscribeOpenOrCreateError as OpenOrCreate,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use tandem_msg::{Header, Message};

use crate::wire::{Wire, schema_hash};
use crate::{BusError, Instance, Intent, Latest, Publisher};

/// One writer, and its successor for as long as a predecessor is not cleaned up.
const PUBLISHERS_MAX: usize = 2;
const SUBSCRIBERS_MAX: usize = 4;
const NODES_MAX: usize = 16;
/// The latest value is all there is.
const HISTORY: usize = 1;
const BUFFER: usize = 1;
/// The value held and the one that replaces it.
const BORROWED: usize = 2;
/// Between two attempts.
const PAUSE: Duration = Duration::from_millis(5);
const SCHEMA: &str = "schema";
const CONFIG: &str = "config";

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

/// One process's place on the bus. Ports are bound to the thread that opened the node.
pub struct Node {
    inner: iceoryx2::node::Node<ipc::Service>,
    identity: Identity,
    deadline: Duration,
}

impl Node {
    /// Joins the bus of a cell. No signal handler is installed. Whatever is opened
    /// from this node is tried again until `deadline` has passed, when the trouble may be passing.
    ///
    /// # Errors
    /// [`BusError::Node`].
    pub fn open(instance: &Instance, identity: Identity, deadline: Duration) -> Result<Self, BusError> {
        let config = instance.config();
        let name: NodeName = identity.role.as_str().try_into().unwrap_or_default();
        let create = || {
            NodeBuilder::new()
                .config(&config)
                .name(&name)
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .create::<ipc::Service>()
        };
        match until(deadline, create, |_| true) {
            Ok(inner) => Ok(Self { inner, identity, deadline }),
            Err((cause, waited)) => Err(BusError::Node {
                instance: instance.id().to_owned(),
                root: instance.root().to_owned(),
                role: identity.role,
                waited,
                cause,
            }),
        }
    }

    /// The writing end of a service.
    ///
    /// # Errors
    /// `InvalidService`, `Service`, `Mismatch`, `WriterPort`.
    pub fn publisher<M: Message>(&self, service: &str) -> Result<Publisher<M>, BusError> {
        let factory = self.service::<M>(service, Intent::Write)?;
        let create = || {
            factory
                .publisher_builder()
                .max_loaned_samples(1)
                // Overflow is on, so this never acts; the default would block.
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let passing = |cause: &PublisherCreateError| *cause == PublisherCreateError::ExceedsMaxSupportedPublishers;
        match until(self.deadline, create, passing) {
            Ok(port) => Ok(Publisher::new(port, self.header())),
            Err((cause, waited)) => Err(BusError::WriterPort {
                service: service.to_owned(),
                role: self.identity.role.clone(),
                waited,
                cause,
            }),
        }
    }

    /// The reading end of a service.
    ///
    /// # Errors
    /// `InvalidService`, `Service`, `Mismatch`, `ReaderPort`.
    pub fn latest<M: Message>(&self, service: &str) -> Result<Latest<M>, BusError> {
        let factory = self.service::<M>(service, Intent::Read)?;
        let create = || factory.subscriber_builder().buffer_size(BUFFER).history_request(HISTORY).create();
        match until(self.deadline, create, |_| true) {
            Ok(port) => Ok(Latest::new(port)),
            Err((cause, waited)) => Err(BusError::ReaderPort {
                service: service.to_owned(),
                role: self.identity.role.clone(),
                waited,
                cause,
            }),
        }
    }

    fn header(&self) -> Header {
        Header { epoch: self.identity.epoch, config_hash: self.identity.config_hash, ..Header::default() }
    }

    fn service<M: Message>(
        &self,
        service: &str,
        intent: Intent,
    ) -> Result<PortFactory<ipc::Service, Wire<M>, ()>, BusError> {
        let invalid = || BusError::InvalidService { service: service.to_owned() };
        let name: ServiceName = service.try_into().map_err(|_| invalid())?;
        let ours = [(SCHEMA, schema_hash::<M>()), (CONFIG, self.identity.config_hash)];
        let mut verifier = AttributeVerifier::new();
        for (key, value) in ours {
            let key = key.try_into().expect("a short word");
            verifier =
                verifier.require(&key, &hex(value).as_str().try_into().expect("16 digits")).expect("two of many");
        }
        let open = || {
            self.inner
                .service_builder(&name)
                .publish_subscribe::<Wire<M>>()
                .max_publishers(PUBLISHERS_MAX)
                .max_subscribers(SUBSCRIBERS_MAX)
                .max_nodes(NODES_MAX)
                .history_size(HISTORY)
                .subscriber_max_buffer_size(BUFFER)
                .subscriber_max_borrowed_samples(BORROWED)
                .enable_safe_overflow(true)
                .open_or_create_with_attributes(&verifier)
        };
        until(self.deadline, open, passing).map_err(|(cause, waited)| {
            let (service, role) = (service.to_owned(), self.identity.role.clone());
            match self.difference(&name, &ours).filter(|_| incompatible(&cause)) {
                Some((field, found, ours)) => BusError::Mismatch { service, role, intent, field, found, ours },
                None => BusError::Service { service, role, intent, waited, cause },
            }
        })
    }

    /// The first attribute the existing service has otherwise: key, value there, value here.
    fn difference(&self, name: &ServiceName, ours: &[(&'static str, u64)]) -> Option<(&'static str, String, String)> {
        let details =
            ipc::Service::details(name, self.inner.config(), MessagingPattern::PublishSubscribe).ok().flatten()?;
        ours.iter().find_map(|&(key, value)| {
            let found = details.static_details.attributes().key_value(&key.try_into().ok()?, 0)?.to_string();
            (found != hex(value)).then(|| (key, found, hex(value)))
        })
    }
}

fn hex(value: u64) -> String {
    format!("{value:016x}")
}

fn incompatible(cause: &OpenOrCreate) -> bool {
    use OpenOrCreate::PublishSubscribeOpenError as Opening;
    matches!(cause, Opening(Open::IncompatibleAttributes | Open::IncompatibleTypes))
}

/// Whether waiting may help: a peer is creating, leaving or being cleaned up.
fn passing(cause: &OpenOrCreate) -> bool {
    use OpenOrCreate::{PublishSubscribeCreateError as Creating, PublishSubscribeOpenError as Opening};
    match cause {
        Opening(open) => matches!(
            open,
            Open::DoesNotExist
                | Open::InternalFailure
                | Open::ServiceInCorruptedState
                | Open::HangsInCreation
                | Open::IsMarkedForDestruction
                | Open::ExceedsMaxNumberOfNodes
                | Open::UnableToCreateServiceTag
                | Open::Interrupt
        ),
        Creating(create) => {
            !matches!(create, Create::InsufficientPermissions | Create::SubscriberBufferMustBeLargerThanHistorySize)
        }
        _ => true,
    }
}

/// Tries until it succeeds, the trouble is not `passing`, or `deadline` has passed.
fn until<T, E>(
    deadline: Duration,
    mut attempt: impl FnMut() -> Result<T, E>,
    passing: impl Fn(&E) -> bool,
) -> Result<T, (E, Duration)> {
    let start = Instant::now();
    loop {
        match attempt() {
            Ok(done) => return Ok(done),
            Err(cause) if !passing(&cause) || start.elapsed() >= deadline => return Err((cause, start.elapsed())),
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
}
