//! The bounded opening of services.

use std::fmt::Debug;
use std::time::{Duration, Instant};

use iceoryx2::prelude::{AttributeVerifier, MessagingPattern, Service, ServiceName, ZeroCopySend, ipc};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError as Create, PublishSubscribeOpenError as Open,
    PublishSubscribeOpenOrCreateError as OpenOrCreate,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::node::Joining;
use crate::{BusError, Intent};

/// One writer, and its successor for as long as a predecessor is not cleaned up.
const PUBLISHERS_MAX: usize = 2;
const NODES_MAX: usize = 24;
/// The latest value is all there is.
pub(crate) const HISTORY: usize = 1;
pub(crate) const BUFFER: usize = 1;
/// The value held and the one that replaces it.
const BORROWED: usize = 2;
/// Between two attempts.
const PAUSE: Duration = Duration::from_millis(1);
const SCHEMA: &str = "schema";
const CONFIG: &str = "config";

/// A service that is to be opened.
pub(crate) struct Opening<'a> {
    pub(crate) node: &'a iceoryx2::node::Node<ipc::Service>,
    pub(crate) joining: &'a Joining,
    pub(crate) service: &'a str,
    pub(crate) kind: Kind,
}

/// How a service carries its messages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    /// Fingerprint of message and way.
    pub(crate) schema: u64,
    /// Readers there is room and memory for.
    pub(crate) subscribers_max: usize,
}

impl Opening<'_> {
    pub(crate) fn open<T: ZeroCopySend + Debug>(
        &self,
        intent: Intent,
    ) -> Result<PortFactory<ipc::Service, T, ()>, BusError> {
        let identity = &self.joining.identity;
        let invalid = || BusError::InvalidService { service: self.service.to_owned() };
        let name: ServiceName = self.service.try_into().map_err(|_| invalid())?;
        let ours = [(SCHEMA, self.kind.schema), (CONFIG, identity.config_hash)];
        let mut verifier = AttributeVerifier::new();
        for (key, value) in ours {
            let key = key.try_into().expect("a short word");
            verifier =
                verifier.require(&key, &hex(value).as_str().try_into().expect("16 digits")).expect("two of many");
        }
        let open = || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<T>()
                .max_publishers(PUBLISHERS_MAX)
                .max_subscribers(self.kind.subscribers_max)
                .max_nodes(NODES_MAX)
                .history_size(HISTORY)
                .subscriber_max_buffer_size(BUFFER)
                .subscriber_max_borrowed_samples(BORROWED)
                .enable_safe_overflow(true)
                .open_or_create_with_attributes(&verifier)
        };
        until(self.joining.deadline, open, passing).map_err(|(cause, waited)| {
            let (service, role) = (self.service.to_owned(), identity.role.clone());
            match self.difference(&name, &ours).filter(|_| incompatible(&cause)) {
                Some((field, found, ours)) => BusError::Mismatch { service, role, intent, field, found, ours },
                None => BusError::Service { service, role, intent, waited, cause },
            }
        })
    }

    /// The first attribute the existing service has otherwise: key, value there, value here.
    fn difference(&self, name: &ServiceName, ours: &[(&'static str, u64)]) -> Option<(&'static str, String, String)> {
        let details =
            ipc::Service::details(name, self.node.config(), MessagingPattern::PublishSubscribe).ok().flatten()?;
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
pub(crate) fn until<T, E>(
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
