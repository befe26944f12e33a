//! What can go wrong while a process joins the bus. Nothing here happens in a cycle.

use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::node::NodeCreationFailure;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenOrCreateError;

/// What a port is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Intent {
    /// To publish.
    Write,
    /// To read the latest value.
    Read,
}

impl std::fmt::Display for Intent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Write => "write",
            Self::Read => "read",
        })
    }
}

/// Why a process could not join the bus, or leave it clean.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The name cannot be part of a file name.
    #[error("cell instance \"{id}\": allowed are 1 to 40 of a-z, 0-9 and '-'; choose another name")]
    InvalidId {
        /// The name.
        id: String,
    },
    /// The directory cannot be used by the bus.
    #[error(
        "run directory {path}: {length} bytes long, allowed up to {allowed} of UTF-8; set XDG_RUNTIME_DIR to a shorter path"
    )]
    InvalidRoot {
        /// The directory.
        path: PathBuf,
        /// Its length, bytes.
        length: usize,
        /// The longest allowed, bytes.
        allowed: usize,
    },
    /// A node could not be created.
    #[error(
        "cell instance {instance}: {role} cannot join the bus: {cause:?} after {waited:?}; is {root} writable and /dev/shm mounted? `tandem doctor` says more"
    )]
    Node {
        /// The instance.
        instance: String,
        /// Its directory.
        root: PathBuf,
        /// Who wanted to join.
        role: String,
        /// How long it was tried.
        waited: Duration,
        /// What iceoryx2 says.
        cause: NodeCreationFailure,
    },
    /// A service name iceoryx2 does not accept.
    #[error("service \"{service}\": not a valid service name")]
    InvalidService {
        /// The service.
        service: String,
    },
    /// A service could not be opened.
    #[error(
        "service {service}: {role} cannot open it to {intent}: {cause:?} after {waited:?}; `tandem doctor` looks for leftovers"
    )]
    Service {
        /// The service.
        service: String,
        /// Who wanted it.
        role: String,
        /// What for.
        intent: Intent,
        /// How long it was tried.
        waited: Duration,
        /// What iceoryx2 says.
        cause: PublishSubscribeOpenOrCreateError,
    },
    /// The peer that opened the service first speaks of another type or configuration.
    #[error(
        "service {service}: {role} cannot open it to {intent}: {field} is {found} there and {ours} here; all processes of a cell must be of one build and one configuration"
    )]
    Mismatch {
        /// The service.
        service: String,
        /// Who wanted it.
        role: String,
        /// What for.
        intent: Intent,
        /// What differs: `schema` or `config`.
        field: &'static str,
        /// The value the service was created with.
        found: String,
        /// Our own.
        ours: String,
    },
    /// The writing end could not be created.
    #[error(
        "service {service}: {role} cannot write it: {cause:?} after {waited:?}; another writer is alive or was not cleaned up"
    )]
    WriterPort {
        /// The service.
        service: String,
        /// Who wanted it.
        role: String,
        /// How long it was tried.
        waited: Duration,
        /// What iceoryx2 says.
        cause: PublisherCreateError,
    },
    /// The reading end could not be created.
    #[error(
        "service {service}: {role} cannot read it: {cause:?} after {waited:?}; too many readers, or dead ones were not cleaned up"
    )]
    ReaderPort {
        /// The service.
        service: String,
        /// Who wanted it.
        role: String,
        /// How long it was tried.
        waited: Duration,
        /// What iceoryx2 says.
        cause: SubscriberCreateError,
    },
    /// A writer's memory could not be had.
    #[error("service {service}: no memory for a writer; is /dev/shm full? `tandem doctor` says more")]
    NoMemory {
        /// The service.
        service: String,
    },
    /// The thread that keeps a process connected cannot be started.
    #[error("the bus's thread cannot be started: {0}; are there too many threads?")]
    Thread(std::io::Error),
    /// The thread that keeps a process connected ended; this is a defect of Tandem.
    #[error("the bus's thread ended unexpectedly; this is a defect, its message stands above")]
    Ended,
    /// A leftover could not be removed.
    #[error("cannot remove {path}: {cause}; remove it by hand when the cell is not running")]
    Remove {
        /// The file or directory.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
}
