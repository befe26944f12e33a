//! What lies in the file, and the plain values that are read from it.

use core::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use core::time::Duration;

use tandem_msg::Stamp;

use crate::{Histogram, SharedHistogram, SharedRecord};

/// Inputs of a loop whose ages are recorded.
pub const INPUTS_MAX: usize = 8;
/// Longest name of an input, bytes.
pub const NAME_MAX: usize = 24;
/// Longest account of what was not granted, bytes.
const NOTICES_MAX: usize = 1_024;
/// Grows with every change of the layout.
const REVISION: u64 = 2;
/// Begins every file of statistics: revision and length of the layout, which reader and writer must share.
pub(super) const LAYOUT: u64 = 0x7a9d_0000_0000_0000 | (REVISION << 32) | size_of::<Page>() as u64;
/// Stands for "none" where a number may be absent.
const ABSENT: u64 = u64::MAX;

/// A word in the file.
#[derive(Default)]
#[repr(transparent)]
pub(super) struct Word(AtomicU64);

impl Word {
    pub(super) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    pub(super) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    pub(super) fn get_optional(&self) -> Option<u64> {
        Some(self.get()).filter(|value| *value != ABSENT)
    }

    pub(super) fn set_optional(&self, value: Option<u64>) {
        self.set(value.unwrap_or(ABSENT));
    }
}

/// Text in the file, cut to its length.
#[repr(transparent)]
pub(super) struct Letters<const N: usize>([AtomicU8; N]);

impl<const N: usize> Default for Letters<N> {
    fn default() -> Self {
        Self([const { AtomicU8::new(0) }; N])
    }
}

impl<const N: usize> Letters<N> {
    pub(super) fn set(&self, text: &str) {
        let bytes = text.bytes().chain(core::iter::repeat(0));
        self.0.iter().zip(bytes).for_each(|(letter, byte)| letter.store(byte, Ordering::Relaxed));
    }

    pub(super) fn text(&self) -> Text<N> {
        let mut text = Text([0; N]);
        text.0.iter_mut().zip(&self.0).for_each(|(byte, letter)| *byte = letter.load(Ordering::Relaxed));
        text
    }
}

/// Text of bounded length.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const N: usize>([u8; N]);

impl<const N: usize> Text<N> {
    /// The text.
    pub fn as_str(&self) -> &str {
        let length = self.0.iter().position(|byte| *byte == 0).unwrap_or(N);
        let bytes = &self.0[..length];
        // A text that was cut inside a letter ends before it.
        core::str::from_utf8(bytes).or_else(|cut| core::str::from_utf8(&bytes[..cut.valid_up_to()])).unwrap_or_default()
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

impl<const N: usize> core::fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.as_str().fmt(f)
    }
}

/// The file of one role.
#[repr(C)]
pub(super) struct Page {
    pub(super) layout: Word,
    /// 0 while the fields below are being set up for a new incarnation.
    pub(super) epoch: AtomicU64,
    pub(super) role: Word,
    pub(super) pid: Word,
    pub(super) started: Word,
    pub(super) period_ns: Word,
    pub(super) phase_ns: Word,
    pub(super) earlier: EarlierWords,
    pub(super) obtained: ObtainedWords,
    pub(super) guarded: GuardedWords,
    pub(super) record: SharedRecord,
    pub(super) inputs: [InputWords; INPUTS_MAX],
}

#[repr(C)]
pub(super) struct InputWords {
    pub(super) name: Letters<NAME_MAX>,
    pub(super) age: SharedHistogram,
}

/// How old one input of a loop was at the beginning of its cycles.
#[derive(Clone, Debug, Default)]
pub struct Input {
    /// Its service; empty when the loop has fewer inputs.
    pub name: Text<NAME_MAX>,
    /// From the stamp of the value to the instant the cycle stands for, nanoseconds; nothing before the first value.
    pub age: Histogram,
}

impl InputWords {
    pub(super) fn copy_to(&self, copy: &mut Input) {
        copy.name = self.name.text();
        self.age.copy_to(&mut copy.age);
    }
}

#[repr(C)]
pub(super) struct EarlierWords {
    pub(super) incarnations: Word,
    pub(super) cycles: Word,
    pub(super) missed: Word,
    pub(super) overruns: Word,
    pub(super) stops: Word,
}

/// What the predecessors of a role's present process counted, in this run of the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Earlier {
    /// How many there were.
    pub incarnations: u64,
    /// Cycles they ran.
    pub cycles: u64,
    /// Grid points they missed.
    pub missed: u64,
    /// Cycles of theirs that ended late.
    pub overruns: u64,
    /// How many of them were left for being overloaded.
    pub stops: u64,
}

impl EarlierWords {
    pub(super) fn get(&self) -> Earlier {
        Earlier {
            incarnations: self.incarnations.get(),
            cycles: self.cycles.get(),
            missed: self.missed.get(),
            overruns: self.overruns.get(),
            stops: self.stops.get(),
        }
    }

    pub(super) fn set(&self, earlier: &Earlier) {
        self.incarnations.set(earlier.incarnations);
        self.cycles.set(earlier.cycles);
        self.missed.set(earlier.missed);
        self.overruns.set(earlier.overruns);
        self.stops.set(earlier.stops);
    }
}

#[repr(C)]
pub(super) struct ObtainedWords {
    pub(super) priority: Word,
    pub(super) cpu: Word,
    pub(super) locked: Word,
    pub(super) prefaulted: Word,
    pub(super) dma_latency_us: Word,
    pub(super) timer_slack_ns: Word,
    pub(super) notices: Letters<NOTICES_MAX>,
}

/// The realtime set-up of a loop as the kernel confirmed it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Obtained {
    /// Priority under SCHED_FIFO; none under another scheduler.
    pub priority: Option<u8>,
    /// The one processor the loop is bound to; none when it may migrate.
    pub cpu: Option<u32>,
    /// Whether present and future memory of the process is locked.
    pub locked: bool,
    /// Stack touched beforehand, bytes.
    pub prefaulted: u64,
    /// The wake-up latency of idle processors that `/dev/cpu_dma_latency` is held at; none when it is not held.
    pub dma_latency: Option<Duration>,
    /// How late a timer may fire; zero under SCHED_FIFO.
    pub timer_slack: Duration,
    /// What was asked for and not granted, each with the way to mend it; empty when everything was.
    pub notices: Text<NOTICES_MAX>,
}

impl ObtainedWords {
    pub(super) fn get(&self) -> Obtained {
        Obtained {
            priority: self.priority.get_optional().map(|value| value as u8),
            cpu: self.cpu.get_optional().map(|value| value as u32),
            locked: self.locked.get() == 1,
            prefaulted: self.prefaulted.get(),
            dma_latency: self.dma_latency_us.get_optional().map(Duration::from_micros),
            timer_slack: Duration::from_nanos(self.timer_slack_ns.get()),
            notices: self.notices.text(),
        }
    }
}

#[repr(C)]
pub(super) struct GuardedWords {
    pub(super) cycles: Word,
    pub(super) allocations: Word,
    pub(super) minor_faults: Word,
    pub(super) major_faults: Word,
    pub(super) system_calls: Word,
    pub(super) switches: Word,
    pub(super) preemptions: Word,
}

/// What a loop asked of the system since it was warm. All but the cycles should stay at zero;
/// one system call a cycle is the wait for the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Guarded {
    /// Cycles since it was warm: what the other numbers are to be divided by.
    pub cycles: u64,
    /// Calls into the system's allocator on the loop's thread.
    pub allocations: u64,
    /// Page faults that needed no disk.
    pub minor_faults: u64,
    /// Page faults that waited for a disk.
    pub major_faults: u64,
    /// System calls of the loop itself: the wait for each cycle, and a question to the kernel each second.
    /// A role that makes others is found by its test under a tracer; calls that block show in `switches`.
    pub system_calls: u64,
    /// How often the thread gave up the processor by itself: once a cycle, for the wait.
    pub switches: u64,
    /// How often it was taken off the processor.
    pub preemptions: u64,
}

impl GuardedWords {
    pub(super) fn get(&self) -> Guarded {
        Guarded {
            cycles: self.cycles.get(),
            allocations: self.allocations.get(),
            minor_faults: self.minor_faults.get(),
            major_faults: self.major_faults.get(),
            system_calls: self.system_calls.get(),
            switches: self.switches.get(),
            preemptions: self.preemptions.get(),
        }
    }

    pub(super) fn set(&self, guarded: &Guarded) {
        self.cycles.set(guarded.cycles);
        self.allocations.set(guarded.allocations);
        self.minor_faults.set(guarded.minor_faults);
        self.major_faults.set(guarded.major_faults);
        self.system_calls.set(guarded.system_calls);
        self.switches.set(guarded.switches);
        self.preemptions.set(guarded.preemptions);
    }
}

/// When the present incarnation set its loop up.
pub(super) fn started(page: &Page) -> Stamp {
    Stamp(page.started.get())
}
