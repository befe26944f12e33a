//! What is shown, as plain values with their units in their names.

use std::time::Duration;

use serde::Serialize;
use tandem_cycle::Histogram;
use tandem_cycle::stats::Snapshot;
use tandem_msg::{
    CellRequest, Code, Coded, Feature, Header, JointState, MotionStatus, MotionTask, Prompt, PromptKind, Role, RunMode,
    Stamp,
};

/// Octaves of lateness that are shown as bars: below 1 µs, 1 to 2 µs, and so on.
pub(crate) const OCTAVES: usize = 16;

/// A running cell at one instant.
#[derive(Clone, Debug, Serialize)]
pub struct View {
    /// Its name.
    pub cell: String,
    /// Its instance.
    pub instance: String,
    /// What it assembles.
    pub product: String,
    /// What is being done.
    pub step: StepView,
    /// How the arm moves, and why it does not; nothing before the controller has spoken.
    pub motion: Option<MotionView>,
    /// The arm; nothing before it has spoken.
    pub arm: Option<ArmView>,
    /// The loops that have begun.
    pub loops: Vec<LoopView>,
}

/// What is being done.
#[derive(Clone, Debug, Serialize)]
pub struct StepView {
    /// Box, from 1.
    pub number: u32,
    /// The part.
    pub part: Option<String>,
    /// What the arm is to do.
    pub subtask: &'static str,
    /// Whether it may: run, pause, halt.
    pub run: &'static str,
    /// What a person is asked for.
    pub prompt: Option<&'static str>,
    /// The feature that was last recognised.
    pub feature: Option<&'static str>,
    /// How sure that was, 0 to 1.
    pub confidence: f64,
}

/// How the arm moves.
#[derive(Clone, Debug, Serialize)]
pub struct MotionView {
    /// Since the controller said so, milliseconds.
    pub age_ms: f64,
    /// Where the task stands.
    pub phase: &'static str,
    /// Whether the arm may move.
    pub stop: &'static str,
    /// Why not.
    pub cause: &'static str,
    /// Latched stops since the controller's start.
    pub stops: u32,
    /// Smallest distance to what must not be touched, metres.
    pub clearance_m: f64,
    /// The smallest of this task.
    pub clearance_min_m: f64,
    /// To the nearest person; `None` when nobody is in view.
    pub separation_m: Option<f64>,
    /// Owed to that person now.
    pub separation_required_m: f64,
    /// Share of the nominal speed, 0 to 1.
    pub speed: f64,
    /// Of the TCP.
    pub tcp_speed_m_s: f64,
    /// Since the task began.
    pub elapsed_s: f64,
    /// Expected from its beginning to its end.
    pub expected_s: f64,
}

/// The arm.
#[derive(Clone, Debug, Serialize)]
pub struct ArmView {
    /// Since it was measured, milliseconds.
    pub age_ms: f64,
    /// Why its brakes are closed, or `none`.
    pub fault: &'static str,
    /// The tool at its flange.
    pub tool: &'static str,
    /// Whether the tool holds a part.
    pub holding: bool,
    /// Measured, rad.
    pub position_rad: Vec<f64>,
    /// Measured, rad/s.
    pub velocity_rad_s: Vec<f64>,
}

/// A role's loop.
#[derive(Clone, Debug, Serialize)]
pub struct LoopView {
    /// Whose it is.
    pub role: &'static str,
    /// Its process.
    pub pid: u32,
    /// Its incarnation.
    pub epoch: u64,
    /// Processes before it, in this run.
    pub restarts: u64,
    /// The wanted rate, cycles a second.
    pub rate_wanted_hz: f64,
    /// The recent rate.
    pub rate_hz: f64,
    /// Cycles since its start.
    pub cycles: u64,
    /// Grid points missed since its start.
    pub missed: u64,
    /// Cycles that ended after the next grid point.
    pub overruns: u64,
    /// Recent wake-ups after their deadlines.
    pub lateness_recent: Quantiles,
    /// The same since its start.
    pub lateness: Quantiles,
    /// How many of these were below 1 µs, 1 to 2, 2 to 4, and so on; the last: all above.
    pub lateness_octaves: [u64; OCTAVES],
    /// Time in the cycle since its start.
    pub busy: Quantiles,
    /// How old its inputs were when its cycles began, since its start.
    pub inputs: Vec<Age>,
    /// What a cycle asks of the system, since the loop was warm.
    pub per_cycle: PerCycle,
    /// Priority under SCHED_FIFO; `None` under the normal scheduler.
    pub fifo: Option<u8>,
    /// The processor it is bound to.
    pub cpu: Option<u32>,
    /// Whether its memory is locked.
    pub memory_locked: bool,
    /// Stack touched beforehand.
    pub prefaulted_kb: u64,
    /// What processors may take to wake; `None` when nothing holds them.
    pub dma_latency_us: Option<u64>,
    /// How late its timers may fire.
    pub timer_slack_ns: u64,
    /// What was asked for and not granted; empty when everything was.
    pub notices: String,
}

/// Some of a distribution, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50_us: f64,
    /// 99 of 100 are not larger.
    pub p99_us: f64,
    /// 999 of 1000 are not larger.
    pub p99_9_us: f64,
    /// The largest.
    pub max_us: f64,
}

/// How old an input was.
#[derive(Clone, Debug, Serialize)]
pub struct Age {
    /// Its service.
    pub input: String,
    /// Its ages.
    #[serde(flatten)]
    pub age: Quantiles,
}

/// What a cycle asks of the system, on average; all `None` before the loop is warm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerCycle {
    /// Cycles this is the average of.
    pub cycles: u64,
    /// Calls into the allocator.
    pub allocations: Option<f64>,
    /// Page faults, of both kinds.
    pub page_faults: Option<f64>,
    /// System calls; `None` where nothing counts them.
    pub system_calls: Option<f64>,
    /// How often the thread was taken off its processor.
    pub preemptions: Option<f64>,
}

impl Quantiles {
    /// In one pass: a look is taken often, and has many of them.
    pub(crate) fn of(histogram: &Histogram) -> Self {
        let rank = |quantile: f64| (quantile * histogram.total() as f64).ceil().max(1.0) as u64;
        let mut wanted = [0.5, 0.99, 0.999].map(|quantile| (rank(quantile), 0));
        let (mut before, mut seen) = (0, 0);
        for (value_ns, count) in histogram.buckets() {
            seen += count;
            let here = wanted.iter_mut().filter(|(rank, _)| (before + 1..=seen).contains(rank));
            here.for_each(|(_, value)| *value = value_ns.min(histogram.max_ns()));
            before = seen;
        }
        let [p50_us, p99_us, p99_9_us] = wanted.map(|(_, value_ns)| value_ns as f64 / 1e3);
        Self { p50_us, p99_us, p99_9_us, max_us: histogram.max_ns() as f64 / 1e3 }
    }
}

/// The word for a code of a peer, which may be one this program does not know.
fn word<T: Coded>(code: Code<T>) -> &'static str {
    code.get().map_or("unknown", Coded::name)
}

fn age_ms(header: &Header, now: Stamp) -> f64 {
    header.stamp.age_at(now).as_secs_f64() * 1e3
}

impl StepView {
    pub(super) fn of(
        request: &CellRequest,
        part: Option<&str>,
        task: &MotionTask,
        prompt: &Prompt,
        feature: &Feature,
    ) -> Self {
        let asked = prompt.kind.get().filter(|kind| prompt.header.heard() && *kind != PromptKind::None);
        let seen = feature.cloud_seq > 0;
        let best = feature.probabilities.iter().copied().fold(0.0, f32::max);
        Self {
            number: if request.header.heard() { request.box_index + 1 } else { 0 },
            part: part.filter(|_| request.id > 0).map(str::to_owned),
            subtask: word(task.subtask),
            run: if task.header.heard() { word(task.run) } else { RunMode::Halt.name() },
            prompt: asked.map(Coded::name),
            feature: seen.then(|| word(feature.class)),
            confidence: if seen { f64::from(best) } else { 0.0 },
        }
    }
}

impl MotionView {
    pub(super) fn of(status: &MotionStatus, now: Stamp) -> Option<Self> {
        status.header.heard().then(|| Self {
            age_ms: age_ms(&status.header, now),
            phase: word(status.phase),
            stop: word(status.stop),
            cause: word(status.cause),
            stops: status.stop_count,
            clearance_m: status.clearance,
            clearance_min_m: status.clearance_min,
            separation_m: Some(status.separation).filter(|distance| distance.is_finite()),
            separation_required_m: status.separation_required,
            speed: status.speed,
            tcp_speed_m_s: status.tcp_speed,
            elapsed_s: status.elapsed,
            expected_s: status.expected,
        })
    }
}

impl ArmView {
    pub(super) fn of(state: &JointState, now: Stamp) -> Option<Self> {
        let joints = (state.joint_count as usize).min(state.position.len());
        state.header.heard().then(|| Self {
            age_ms: age_ms(&state.header, now),
            fault: word(state.fault),
            tool: word(state.effector.tool),
            holding: state.effector.holding == 1,
            position_rad: state.position[..joints].to_vec(),
            velocity_rad_s: state.velocity[..joints].to_vec(),
        })
    }
}

impl LoopView {
    /// `then` is an earlier look at the same incarnation, `ago` before `now`.
    pub(super) fn of(role: Role, now: &Snapshot, then: &Snapshot, ago: Duration) -> Self {
        let seconds = ago.as_secs_f64();
        let recent = now.record.cycles.saturating_sub(then.record.cycles);
        let per_second = |count: f64| if seconds > 0.0 { count / seconds } else { 0.0 };
        let inputs = now.inputs.iter().filter(|input| !input.name.as_str().is_empty());
        Self {
            role: role.name(),
            pid: now.pid,
            epoch: now.epoch,
            restarts: now.earlier.incarnations,
            rate_wanted_hz: if now.period.is_zero() { 0.0 } else { 1.0 / now.period.as_secs_f64() },
            rate_hz: per_second(recent as f64),
            cycles: now.record.cycles,
            missed: now.record.missed,
            overruns: now.record.overruns,
            lateness_recent: Quantiles::of(&now.record.lateness.since(&then.record.lateness)),
            lateness: Quantiles::of(&now.record.lateness),
            lateness_octaves: octaves(&now.record.lateness),
            busy: Quantiles::of(&now.record.busy),
            inputs: inputs
                .map(|input| Age { input: input.name.as_str().to_owned(), age: Quantiles::of(&input.age) })
                .collect(),
            per_cycle: PerCycle::of(now),
            fifo: now.obtained.priority,
            cpu: now.obtained.cpu,
            memory_locked: now.obtained.locked,
            prefaulted_kb: now.obtained.prefaulted / 1024,
            dma_latency_us: now.obtained.dma_latency.map(|latency| latency.as_micros() as u64),
            timer_slack_ns: now.obtained.timer_slack.as_nanos() as u64,
            notices: now.obtained.notices.as_str().to_owned(),
        }
    }
}

impl PerCycle {
    fn of(snapshot: &Snapshot) -> Self {
        let guarded = &snapshot.guarded;
        let each = |count: u64| (guarded.cycles > 0).then(|| count as f64 / guarded.cycles as f64);
        Self {
            cycles: guarded.cycles,
            allocations: each(guarded.allocations),
            page_faults: each(guarded.minor_faults + guarded.major_faults),
            system_calls: each(guarded.system_calls),
            preemptions: each(guarded.preemptions),
        }
    }
}

fn octaves(histogram: &Histogram) -> [u64; OCTAVES] {
    let mut octaves = [0; OCTAVES];
    for (value_ns, count) in histogram.buckets() {
        let octave = (value_ns / 1_000).checked_ilog2().map_or(0, |octave| octave as usize + 1);
        octaves[octave.min(OCTAVES - 1)] += count;
    }
    octaves
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rate is of the time since the earlier look, a distribution of what came since.
    #[test]
    fn what_is_recent_is_what_came_since_the_earlier_look() {
        let mut then = Snapshot { period: Duration::from_millis(1), ..Snapshot::default() };
        then.record.cycles = 1_000;
        then.record.lateness.record(900_000);
        let mut now = then.clone();
        now.record.cycles = 1_500;
        (0..500).for_each(|_| now.record.lateness.record(10));
        let view = LoopView::of(Role::Plant, &now, &then, Duration::from_millis(500));
        assert_eq!((view.rate_hz, view.rate_wanted_hz), (1_000.0, 1_000.0));
        assert_eq!(view.lateness_recent.max_us, 0.01);
        assert_eq!(view.lateness.max_us, 900.0);
        assert_eq!((view.lateness_octaves[0], view.lateness_octaves[10]), (500, 1));
    }

    /// One pass finds what the histogram itself answers, quantile by quantile.
    #[test]
    fn quantiles_in_one_pass_are_the_histograms_own() {
        let mut histogram = Histogram::default();
        assert_eq!(Quantiles::of(&histogram), Quantiles::default());
        for value in (0..5_000_u64).map(|k| k * k % 77_777) {
            histogram.record(value);
            let at = |quantile| histogram.quantile_ns(quantile) as f64 / 1e3;
            let quantiles = Quantiles::of(&histogram);
            assert_eq!([quantiles.p50_us, quantiles.p99_us, quantiles.p99_9_us], [0.5, 0.99, 0.999].map(at));
            assert_eq!(quantiles.max_us, at(1.0));
        }
    }

    #[test]
    fn what_was_never_counted_is_not_shown_as_zero() {
        let mut snapshot = Snapshot::default();
        assert_eq!(PerCycle::of(&snapshot).allocations, None);
        snapshot.guarded.cycles = 200;
        snapshot.guarded.minor_faults = 100;
        let shown = PerCycle::of(&snapshot);
        assert_eq!((shown.allocations, shown.page_faults, shown.system_calls), (Some(0.0), Some(0.5), Some(0.0)));
    }

    #[test]
    fn a_code_of_a_newer_program_is_unknown_not_wrong() {
        let status = MotionStatus {
            header: Header { seq: 1, ..Header::default() },
            stop: Code::from_raw(99),
            ..MotionStatus::default()
        };
        assert_eq!(MotionView::of(&status, Stamp(0)).map(|view| view.stop), Some("unknown"));
        assert!(MotionView::of(&MotionStatus::default(), Stamp(0)).is_none());
    }
}
