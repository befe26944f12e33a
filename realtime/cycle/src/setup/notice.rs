//! What was asked of the host and not granted, in words.

use core::fmt;

use rustix::io::Errno;

/// One measure that is not in force, and how to mend it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// The kernel refused SCHED_FIFO.
    NoFifo {
        /// The priority that was asked for.
        priority: u8,
        /// What the kernel said.
        cause: Errno,
    },
    /// The thread cannot run on that processor.
    NoSuchCpu {
        /// The processor.
        cpu: u32,
        /// What the kernel said.
        cause: Errno,
    },
    /// The kernel refused to lock memory.
    NotLocked {
        /// What the kernel said.
        cause: Errno,
    },
    /// Memory may be locked only up to a limit; locking what is yet to come could make a later allocation fail.
    LockLimited {
        /// RLIMIT_MEMLOCK, bytes.
        limit: u64,
    },
    /// The kernel may let idle processors sleep deeper than was asked.
    LatencyNotHeld {
        /// What the kernel said.
        cause: Errno,
    },
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoFifo { priority, cause } => write!(
                f,
                "SCHED_FIFO priority {priority} refused ({cause}): cycles will be late under load; allow it with \
                 `ulimit -r {priority}`, an rtprio line in /etc/security/limits.conf, or the capability cap_sys_nice"
            ),
            Self::NoSuchCpu { cpu, cause } => {
                write!(f, "processor {cpu} is not available ({cause}): the loop may migrate; correct realtime.cpus")
            }
            Self::NotLocked { cause } => write!(
                f,
                "memory not locked ({cause}): a page fault may delay a cycle; allow it with `ulimit -l unlimited`, a \
                 memlock line in /etc/security/limits.conf, or the capability cap_ipc_lock"
            ),
            Self::LockLimited { limit } => write!(
                f,
                "memory not locked: RLIMIT_MEMLOCK is {limit} bytes, unlimited is needed, or a later allocation could \
                 fail; a page fault may delay a cycle; allow it with `ulimit -l unlimited` or a memlock line in \
                 /etc/security/limits.conf"
            ),
            Self::LatencyNotHeld { cause } => write!(
                f,
                "/dev/cpu_dma_latency cannot be held ({cause}): an idle processor may wake up late; run as root or make \
                 the file writable, or leave realtime.cpu_dma_latency_us away"
            ),
        }
    }
}

/// One for each kind of [`Notice`] a loop can get: processor, scheduler, memory, idle processors.
pub const NOTICES_MAX: usize = 4;

/// What was not granted, in fixed memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notices([Option<Notice>; NOTICES_MAX]);

impl Notices {
    pub(super) fn add(&mut self, outcome: Result<(), Notice>) {
        if let (Err(notice), Some(free)) = (outcome, self.0.iter_mut().find(|slot| slot.is_none())) {
            *free = Some(notice);
        }
    }

    /// Everything was granted.
    pub fn is_empty(&self) -> bool {
        self.0[0].is_none()
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = &Notice> {
        self.0.iter().flatten()
    }
}

impl fmt::Display for Notices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, notice) in self.iter().enumerate() {
            write!(f, "{}{notice}", if index == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}
