//! Every state the stop monitor can reach, by every input that tells one from another.
//!
//! The monitor has counters and stamps without end; what its decisions depend on
//! is finite: how far the reset count is ahead, and how long no cause has been
//! seen up to the delay. Two monitors alike in that are one state here, and the
//! search goes on until there is no new one.

use std::collections::{BTreeMap, VecDeque};

use super::*;

const PERIOD: u64 = 1_000_000;
const DELAY: Duration = Duration::from_millis(3);

/// What decisions depend on: state, cause, category, armed, resets ahead, periods without a cause.
type Key = (u32, u32, u32, bool, i64, u64);

/// A monitor, the time, and the reset count it was told last.
#[derive(Clone, Copy)]
struct Place {
    monitor: StopMonitor,
    now: Stamp,
    reset_count: u32,
}

impl Place {
    fn key(&self) -> Key {
        let monitor = &self.monitor;
        let ahead = i64::from(self.reset_count) - i64::from(monitor.reset_seen);
        let clear = monitor.clear_since.map_or(0, |since| 1 + since.age_at(self.now).as_nanos() as u64 / PERIOD);
        let clear = clear.min(2 + DELAY.as_nanos() as u64 / PERIOD);
        (monitor.state.code(), monitor.cause.code(), monitor.category.code(), monitor.armed, ahead.clamp(-1, 1), clear)
    }
}

/// All inputs that differ: no cause, each cause, two at once; at rest or not; no reset, the same count, one
/// more, or a supervisor that is not believed; and one that begins to count anew.
fn inputs(reset_count: u32) -> Vec<Seen> {
    let mut causes = vec![Causes::default()];
    for &cause in StopCause::ALL.iter().filter(|cause| **cause != StopCause::None) {
        let mut one = Causes::default();
        one.add(cause);
        causes.push(one);
        one.add(StopCause::Separation);
        causes.push(one);
    }
    let mut all = Vec::new();
    for &causes in &causes {
        for standstill in [false, true] {
            for reset_count in [None, Some(reset_count), Some(reset_count + 1)] {
                all.push(Seen { causes, standstill, reset_count, supervisor_restarted: false });
            }
            all.push(Seen { causes, standstill, reset_count: Some(0), supervisor_restarted: true });
        }
    }
    all
}

fn explore(resume_after_separation: bool) -> usize {
    let start = Place { monitor: StopMonitor::new(resume_after_separation, DELAY), now: Stamp(PERIOD), reset_count: 5 };
    let mut known = BTreeMap::from([(start.key(), ())]);
    let mut open = VecDeque::from([start]);
    while let Some(place) = open.pop_front() {
        for seen in inputs(place.reset_count) {
            let mut next = place;
            next.now = place.now.after(Duration::from_nanos(PERIOD));
            next.monitor.update(next.now, &seen);
            next.reset_count = seen.reset_count.unwrap_or(place.reset_count);
            judge(&place.monitor, &seen, &next.monitor, resume_after_separation);
            if known.insert(next.key(), ()).is_none() {
                open.push_back(next);
            }
        }
    }
    known.len()
}

/// What no transition may do.
fn judge(before: &StopMonitor, seen: &Seen, after: &StopMonitor, resume_after_separation: bool) {
    let what = || format!("{before:?}\n{seen:?}\n{after:?}");
    let cause = seen.causes.worst();
    let released = seen.reset_count.is_some_and(|count| count > before.reset_seen);
    if after.state == StopState::Running {
        assert_eq!(cause, None, "runs with a cause: {}", what());
        assert_eq!(after.cause, StopCause::None, "{}", what());
    }
    match (before.state, after.state) {
        (StopState::Stopping, StopState::Running) => panic!("ran on without standing: {}", what()),
        (StopState::Stopping, StopState::Stopped) => assert!(seen.standstill, "{}", what()),
        (StopState::Stopped, StopState::Running) if before.armed => {
            let by_itself = resume_after_separation
                && before.cause == StopCause::Separation
                && before.category == StopCategory::Two;
            assert!(released || by_itself, "ran without release: {}", what());
        }
        (StopState::Running, StopState::Running) => assert_eq!(cause, None, "{}", what()),
        (StopState::Running, StopState::Stopping) => {
            assert_eq!(Some(after.cause), cause, "{}", what());
            assert_eq!(after.count, before.count + 1, "{}", what());
        }
        (StopState::Running, StopState::Stopped) | (StopState::Stopped, StopState::Stopping) => {
            panic!("no such transition: {}", what())
        }
        _ => {}
    }
    if before.armed && before.state != StopState::Running && after.state != StopState::Running {
        assert_eq!(after.cause, before.cause, "the first cause stays: {}", what());
        assert!(after.category <= before.category, "only stricter: {}", what());
        assert!(cause.is_none_or(|cause| after.category <= category(cause)), "{}", what());
    }
    if before.armed {
        assert!(after.armed && after.count >= before.count, "{}", what());
    }
}

/// With and without resuming by itself: all that can be reached, and nothing that may not be.
#[test]
fn no_reachable_state_breaks_a_rule() {
    for resume_after_separation in [false, true] {
        let states = explore(resume_after_separation);
        assert!(states > 200, "{states} states: the search saw nothing");
    }
}
