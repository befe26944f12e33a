//! Which role runs next: the shared grid on a virtual clock.

use tandem_config::Timing;
use tandem_msg::{Role, Stamp};

/// The order in which roles run that fall on the same instant.
const ORDER: [Role; 4] = [Role::Plant, Role::Controller, Role::Perception, Role::Supervisor];

/// The next instant of each role, and the spacing of its instants, nanoseconds.
pub(super) struct Schedule([(Stamp, u64); 4]);

impl Schedule {
    /// A schedule that begins with the first instant of each role.
    pub(super) fn new(timing: &Timing) -> Self {
        Self(ORDER.map(|role| {
            let slot = timing.of(role);
            (Stamp::default().after(slot.phase), Stamp::default().after(slot.period).0)
        }))
    }

    /// The role that runs next, and when.
    pub(super) fn advance(&mut self) -> (Role, Stamp) {
        let earliest = |best: usize, index: usize| if self.0[index].0 < self.0[best].0 { index } else { best };
        let index = (1..ORDER.len()).fold(0, earliest);
        let (now, period) = self.0[index];
        self.0[index].0 = Stamp(now.0 + period);
        (ORDER[index], now)
    }
}
