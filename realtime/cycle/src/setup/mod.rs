//! What a loop asks of the host, and what it was granted.
//!
//! Each measure is tried, then *read back*: what is reported is what the kernel
//! says is in force, not what was asked for. What is missing becomes a
//! [`Notice`] with the way to mend it. With [`Policy::Enforce`] anything missing
//! refuses the start.

mod latency;
mod memory;
mod notice;
mod scheduling;

pub use notice::{NOTICES_MAX, Notice, Notices};

/// What to do when the host does not grant something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// Refuse to start.
    Enforce,
    /// Start, and say what is degraded.
    BestEffort,
}

/// What a loop asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wish {
    /// What to do when something is not granted.
    pub policy: Policy,
    /// Priority under SCHED_FIFO, 1 to 99; none leaves the scheduler as it is.
    pub priority: Option<u8>,
    /// Processor to run on; none lets the kernel choose.
    pub cpu: Option<u32>,
    /// Whether memory shall be locked and touched beforehand.
    pub lock_memory: bool,
    /// What `/dev/cpu_dma_latency` shall be held at, microseconds, so that idle processors wake up in time; none
    /// leaves it to the kernel. Held for as long as the process lives.
    pub dma_latency_us: Option<u32>,
}

/// What is in force for the calling thread, as read back from the kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Granted {
    /// Priority under SCHED_FIFO; none under another scheduler.
    pub priority: Option<u8>,
    /// The one processor the thread is bound to; none when it may run on several.
    pub cpu: Option<u32>,
    /// Whether present and future memory of the process is locked.
    pub locked: bool,
    /// Stack that was touched beforehand, bytes.
    pub prefaulted: u64,
    /// What `/dev/cpu_dma_latency` is held at, microseconds; none when it is not held.
    pub dma_latency_us: Option<u64>,
    /// How late a timer may fire, nanoseconds; 0 under SCHED_FIFO.
    pub timer_slack_ns: u64,
    /// What was asked for and not granted.
    pub notices: Notices,
}

/// The host did not grant what [`Policy::Enforce`] demands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Denied(pub Notices);

impl core::fmt::Display for Denied {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "realtime.policy = \"enforce\", and this host does not grant it: {}", self.0)
    }
}

impl core::error::Error for Denied {}

/// Sets up the calling thread, and the memory of its process. Threads it starts
/// afterwards do not inherit its priority.
///
/// # Errors
/// Under [`Policy::Enforce`]: anything asked for was not granted.
pub fn acquire(wish: &Wish) -> Result<Granted, Denied> {
    let mut notices = Notices::default();
    if wish.lock_memory {
        notices.add(memory::lock());
    }
    scheduling::tighten_timers();
    if let Some(cpu) = wish.cpu {
        notices.add(scheduling::bind(cpu));
    }
    if let Some(priority) = wish.priority {
        notices.add(scheduling::fifo(priority));
    }
    let mut dma_latency_us = None;
    if let Some(wanted) = wish.dma_latency_us {
        let held = latency::hold(wanted);
        dma_latency_us = held.is_ok().then_some(wanted.into());
        notices.add(held);
    }
    let prefaulted = if wish.lock_memory { memory::touch_stack() } else { 0 };
    let granted = Granted {
        priority: scheduling::fifo_in_force(),
        cpu: scheduling::bound_to(),
        locked: wish.lock_memory && memory::locked_in_force(),
        prefaulted,
        dma_latency_us,
        timer_slack_ns: scheduling::timer_slack_ns(),
        notices,
    };
    match wish.policy {
        Policy::Enforce if !notices.is_empty() => Err(Denied(notices)),
        _ => Ok(granted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Wish =
        Wish { policy: Policy::BestEffort, priority: None, cpu: None, lock_memory: false, dma_latency_us: None };

    fn on_own_thread(wish: Wish) -> Result<Granted, Denied> {
        std::thread::spawn(move || acquire(&wish)).join().expect("it ends")
    }

    /// What is reported is in force or in the notices, whoever runs the test.
    #[test]
    fn what_was_asked_is_in_force_or_noticed() {
        let granted = on_own_thread(Wish { priority: Some(10), ..NOTHING }).expect("best effort never refuses");
        assert!((granted.priority == Some(10)) == granted.notices.is_empty(), "{granted:?}");
        let enforced = on_own_thread(Wish { priority: Some(10), policy: Policy::Enforce, ..NOTHING });
        assert_eq!(enforced.is_ok(), granted.priority == Some(10), "{enforced:?}");
    }

    #[test]
    fn a_thread_is_bound_to_the_processor_it_asked_for() {
        let allowed = rustix::thread::sched_getaffinity(None).expect("readable");
        let cpu = (0..rustix::thread::CpuSet::MAX_CPU).find(|cpu| allowed.is_set(*cpu)).expect("we run somewhere");
        let granted = on_own_thread(Wish { cpu: Some(cpu as u32), ..NOTHING }).expect("best effort never refuses");
        assert_eq!((granted.cpu, granted.notices), (Some(cpu as u32), Notices::default()));
    }

    #[test]
    fn a_processor_that_is_not_there_is_named() {
        let wish = Wish { cpu: Some(1_000), policy: Policy::Enforce, ..NOTHING };
        let denied = on_own_thread(wish).expect_err("no machine of ours has it");
        let text = denied.to_string();
        assert!(text.contains("processor 1000 is not available") && text.contains("realtime.cpus"), "{text}");
    }

    #[test]
    fn nothing_asked_changes_nothing() {
        let granted = on_own_thread(NOTHING).expect("best effort never refuses");
        assert_eq!((granted.priority, granted.locked, granted.notices), (None, false, Notices::default()));
    }
}
