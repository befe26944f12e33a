//! Whether the roles of a cell live, by what is heard of them and of their processes.
//!
//! ```text
//! Starting --word of this incarnation--> Up --death, silence--> Lost --process started anew--> Starting
//! ```
//! Two sources: the [`Warden`](super::warden) sees a process end; here is seen that
//! one which lives says nothing. Silence is counted in cycles of the observer, not
//! in time: when the whole machine stands still, nobody is accused of it.

use std::time::Duration;

use tandem_msg::Header;

/// What became of a role's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Loss {
    /// Ended by a signal.
    Killed {
        /// The signal.
        signal: i32,
    },
    /// Ended by itself.
    Exited {
        /// Its exit code.
        code: i32,
    },
    /// Lives, but its stamps stood still; it was killed.
    Silent,
    /// Lived, but never spoke; it was killed.
    NeverReady,
}

/// How a role is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Its process was started and has not spoken yet.
    Starting,
    /// It speaks.
    Up,
    /// It is gone.
    Lost(Loss),
}

/// How long a role may be silent, in cycles of the observer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Between two values it publishes.
    pub(super) silence: u32,
    /// Until it speaks for the first time.
    pub(super) start: u32,
}

impl Patience {
    /// Rounded up to whole cycles of `period`.
    pub(super) fn new(silence: Duration, start: Duration, period: Duration) -> Self {
        let cycles = |d: Duration| u32::try_from(d.as_nanos().div_ceil(period.as_nanos().max(1))).unwrap_or(u32::MAX);
        Self { silence: cycles(silence), start: cycles(start) }
    }
}

/// Follows one role.
#[derive(Debug)]
pub(super) struct Health {
    state: State,
    patience: Patience,
    epoch: u64,
    last: (u64, u64),
    /// Cycles in which nothing new was heard.
    quiet: u32,
}

impl Health {
    /// A role whose first incarnation is being started.
    pub(super) fn new(patience: Patience) -> Self {
        Self { state: State::Starting, patience, epoch: 1, last: (0, 0), quiet: 0 }
    }

    /// How it is.
    pub(super) fn state(&self) -> State {
        self.state
    }

    /// Its process was started as that incarnation.
    pub(super) fn started(&mut self, epoch: u64) {
        *self = Self { state: State::Starting, epoch, quiet: 0, ..*self };
    }

    /// Its process is gone.
    pub(super) fn lost(&mut self, loss: Loss) {
        // Who was killed for being silent is lost by silence, not by our signal.
        if !matches!(self.state, State::Lost(_)) {
            self.state = State::Lost(loss);
        }
    }

    /// One cycle of the observer: `pulse` is the header of what the role publishes
    /// most often. Answers with a loss when the role has just been found silent and is to be killed.
    pub(super) fn observe(&mut self, pulse: &Header) -> Option<Loss> {
        let heard = (pulse.epoch, pulse.seq);
        let moved = heard != self.last && pulse.heard() && pulse.epoch >= self.epoch;
        self.last = heard;
        self.quiet = if moved { 0 } else { self.quiet.saturating_add(1) };
        let (limit, loss) = match self.state {
            State::Starting if moved => {
                self.state = State::Up;
                return None;
            }
            State::Starting => (self.patience.start, Loss::NeverReady),
            State::Up => (self.patience.silence, Loss::Silent),
            State::Lost(_) => return None,
        };
        (self.quiet > limit).then(|| {
            self.state = State::Lost(loss);
            loss
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Patience = Patience { silence: 3, start: 10 };

    fn header(epoch: u64, seq: u64) -> Header {
        Header { seq, epoch, ..Header::default() }
    }

    #[test]
    fn a_role_is_up_when_it_speaks_and_lost_when_it_falls_silent() {
        let mut health = Health::new(PATIENCE);
        assert_eq!((health.observe(&header(0, 0)), health.state()), (None, State::Starting));
        assert_eq!((health.observe(&header(1, 1)), health.state()), (None, State::Up));
        for _ in 0..3 {
            assert_eq!(health.observe(&header(1, 1)), None);
        }
        assert_eq!(health.observe(&header(1, 1)), Some(Loss::Silent));
        assert_eq!(health.observe(&header(1, 1)), None, "it is told once");
        health.lost(Loss::Killed { signal: 9 });
        assert_eq!(health.state(), State::Lost(Loss::Silent), "our own kill is not the cause");
    }

    #[test]
    fn a_successor_is_up_only_by_its_own_word() {
        let mut health = Health::new(PATIENCE);
        health.observe(&header(1, 7));
        health.lost(Loss::Killed { signal: 9 });
        health.started(2);
        health.observe(&header(1, 8));
        assert_eq!(health.state(), State::Starting, "its predecessor's last word does not count");
        health.observe(&header(2, 1));
        assert_eq!(health.state(), State::Up);
    }

    #[test]
    fn a_role_that_never_speaks_is_given_up_in_time() {
        let mut health = Health::new(PATIENCE);
        let silent = (1..=20).find(|_| health.observe(&header(0, 0)).is_some());
        assert_eq!((silent, health.state()), (Some(11), State::Lost(Loss::NeverReady)));
    }

    #[test]
    fn patience_is_rounded_up() {
        let ms = Duration::from_millis;
        let patience = Patience::new(ms(95), ms(1), ms(10));
        assert_eq!((patience.silence, patience.start), (10, 1));
    }
}
