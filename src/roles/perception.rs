//! Perception and its ports.

use tandem_bus::{Read, Write};
use tandem_msg::{Feature, Header, PointCloud, Stamp};

use super::{Ports, service};
use crate::perception::Perception;

/// Perception with its ports.
pub struct PerceptionRole<P: Ports> {
    perception: Perception,
    seen: Feature,
    cloud: P::Borrower<PointCloud>,
    feature: P::Writer<Feature>,
    unsent: u64,
}

impl<P: Ports> PerceptionRole<P> {
    /// Opens perception's ports.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open(ports: &P, perception: Perception) -> Result<Self, P::Error> {
        Ok(Self {
            perception,
            seen: Feature::default(),
            cloud: ports.borrower(service::CLOUD)?,
            feature: ports.writer(service::FEATURE)?,
            unsent: 0,
        })
    }

    /// One cycle: looks at the newest cloud where it lies, publishes what is known.
    pub fn cycle(&mut self, now: Stamp) {
        self.perception.cycle(now, self.cloud.read(), &mut self.seen);
        self.unsent += u64::from(self.feature.publish(now, &self.seen).is_err());
    }

    /// Header of the last value heard of each input, in the order of [`service::inputs`].
    pub fn heard(&self) -> [Header; 1] {
        [self.cloud.held().header]
    }

    /// Messages that reached nobody because the bus had no room.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
