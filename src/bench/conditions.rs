//! Under what conditions was measured.

use std::fs::read_to_string;

use serde::Serialize;

/// The machine, and what it did besides, from the beginning of a bench to its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Conditions {
    /// Its processor.
    pub machine: String,
    /// How many of them may be used.
    pub processors: usize,
    /// Its kernel.
    pub kernel: String,
    /// Load at the beginning and at the end, of the last minute.
    pub load: [f64; 2],
    /// Share of the processors' time a hypervisor took meanwhile.
    pub steal_share: f64,
    /// Priority under SCHED_FIFO the measured loops were granted; none = the normal scheduler.
    pub fifo: Option<u8>,
    /// Whether their memory was locked.
    pub memory_locked: bool,
    /// Processor they were bound to.
    pub cpu: Option<u32>,
}

/// Ticks of the whole machine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ticks {
    stolen: f64,
    all: f64,
}

impl Conditions {
    /// What is known at the beginning.
    pub(super) fn now() -> Self {
        let cpu = read_to_string("/proc/cpuinfo").unwrap_or_default();
        let named =
            |key: &str| cpu.lines().find(|line| line.starts_with(key))?.split_once(':').map(|(_, name)| name.trim());
        let machine = named("model name").or(named("Model")).unwrap_or("unknown").to_owned();
        let virtual_machine = cpu.lines().any(|line| line.starts_with("flags") && line.contains(" hypervisor"));
        Self {
            machine: if virtual_machine { format!("{machine}, virtual machine") } else { machine },
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            kernel: kernel(),
            load: [load(); 2],
            ..Self::default()
        }
    }

    /// What is known at the end; `before` are the ticks of the beginning.
    pub(super) fn end(&mut self, before: Ticks) {
        let after = Ticks::now();
        let all = after.all - before.all;
        self.load[1] = load();
        self.steal_share = if all > 0.0 { (after.stolen - before.stolen) / all } else { 0.0 };
    }
}

impl Ticks {
    /// Of all processors since the machine was started.
    pub(super) fn now() -> Self {
        let text = read_to_string("/proc/stat").unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("cpu ")).unwrap_or_default();
        let times: Vec<f64> = line.split_whitespace().flat_map(str::parse).collect();
        // Guest times, the ninth and tenth, are part of the first two.
        Self { stolen: times.get(7).copied().unwrap_or(0.0), all: times.iter().take(8).sum() }
    }
}

fn kernel() -> String {
    let read = |file: &str| read_to_string(file).unwrap_or_default().trim().to_owned();
    let version = read("/proc/sys/kernel/version");
    let model = version.split_whitespace().find(|word| word.starts_with("PREEMPT")).unwrap_or("no PREEMPT").to_owned();
    format!("Linux {} {model}", read("/proc/sys/kernel/osrelease"))
}

fn load() -> f64 {
    let text = read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
}
