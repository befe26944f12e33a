//! The reading end of a channel.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tandem_msg::{Header, Message};

use crate::Read;
use crate::channel::Look;
use crate::link::{Claim, Door};

/// Between two looks for a first value.
const PAUSE: Duration = Duration::from_millis(1);

/// The latest value of one service; keeps the last one also when its writer is dead.
pub struct Latest<M: Message> {
    door: Arc<Door<M>>,
    held: Box<M>,
    /// The next value is copied here first.
    incoming: Box<M>,
    /// Number of the publication seen last, of the present channel.
    seen: u64,
    torn: u64,
    _claim: Claim,
}

impl<M: Message> Latest<M> {
    pub(crate) fn new(door: Arc<Door<M>>, claim: Claim) -> Self {
        Self { door, held: Box::default(), incoming: Box::default(), seen: 0, torn: 0, _claim: claim }
    }

    /// Waits for the first value, at most so long; answers whether there is one. For whoever joins to look, never in a cycle.
    pub fn wait(&mut self, patience: Duration) -> bool {
        let start = Instant::now();
        while !self.read().header().heard() && start.elapsed() < patience {
            std::thread::sleep(PAUSE);
        }
        self.held.header().heard()
    }

    /// Reads that kept the value they had: the writer was too fast, or a connection broken.
    pub fn failures(&self) -> u64 {
        self.torn + self.door.failures()
    }
}

impl<M: Message> Read<M> for Latest<M> {
    /// # Realtime
    /// Copies a new value once; a few loads when there is none. Allocates nothing, makes no system call, whoever
    /// comes or goes. Bounded: a copy the writer disturbs is tried a few times.
    fn read(&mut self) -> &M {
        if let Some((channel, changed)) = self.door.enter() {
            let seen = if changed { 0 } else { self.seen };
            match channel.look(seen, &mut self.incoming) {
                Look::Copied(number) => {
                    self.seen = number;
                    if newer(self.incoming.header(), self.held.header()) {
                        std::mem::swap(&mut self.held, &mut self.incoming);
                    }
                }
                Look::Torn => {
                    self.seen = seen;
                    self.torn += 1;
                }
                Look::Same => self.seen = seen,
            }
        }
        &self.held
    }

    fn held(&self) -> &M {
        &self.held
    }
}

/// Whether a value that has just come in replaces the one that is held.
pub(crate) fn newer(incoming: &Header, held: &Header) -> bool {
    incoming.heard() && (!held.heard() || (incoming.epoch, incoming.seq) > (held.epoch, held.seq))
}
