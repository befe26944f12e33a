//! How deep an idle processor sleeps, and who may keep it awake.

use super::{Check, Host, Subject};

/// A processor that needs longer to wake is felt at a millisecond, microseconds.
const WAKE_MAX: i64 = 50;

/// The slowest idle state that is in use.
pub(super) fn states(host: &Host) -> Check {
    const CPUS: &str = "sys/devices/system/cpu";
    let it = Subject("idle_states", "a processor in a deep idle state (C-state) takes its time to wake");
    let mut slowest: Option<(i64, String)> = None;
    for cpu in host.list(CPUS) {
        for state in host.list(&format!("{CPUS}/{cpu}/cpuidle")) {
            let file = |name: &str| format!("{CPUS}/{cpu}/cpuidle/{state}/{name}");
            if host.number(&file("disable")) == Some(1) {
                continue;
            }
            if let Some(latency) = host.number(&file("latency")) {
                let name = host.read(&file("name")).unwrap_or(state);
                slowest = slowest.max(Some((latency, name)));
            }
        }
    }
    match slowest {
        None => it.ok("the kernel chooses none"),
        Some((latency, name)) if latency <= WAKE_MAX => it.ok(format!("down to {name}, {latency} µs to wake")),
        Some((latency, name)) => it.degraded(
            format!("down to {name}, {latency} µs to wake"),
            format!("cpupower idle-set -D {WAKE_MAX}, or boot with processor.max_cstate=1 intel_idle.max_cstate=1"),
        ),
    }
}

/// Whether a program may ask for short wake-ups.
pub(super) fn request(host: &Host) -> Check {
    let it = Subject("idle_request", "a program that may write here keeps processors out of deep idle states");
    match std::fs::OpenOptions::new().write(true).open(host.root.join("dev/cpu_dma_latency")) {
        Ok(_) => it.ok("/dev/cpu_dma_latency may be written"),
        Err(error) => it.degraded(
            format!("/dev/cpu_dma_latency: {error}"),
            "let this user write it, by a udev rule or its group; in a container: --device /dev/cpu_dma_latency",
        ),
    }
}
