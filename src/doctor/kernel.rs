//! How the kernel lets a realtime loop interrupt it.

use super::host::chosen;
use super::{Check, Host, Subject};

/// Share of each period realtime loops must be allowed.
const RUNTIME_WANTED: f64 = 0.9;

pub(super) fn preemption(host: &Host) -> Check {
    let it = Subject("preemption", "until it can be interrupted, the kernel delays the wake-up of a loop");
    let version = host.read("proc/version").unwrap_or_default();
    let realtime = host.read("sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT");
    // Only root may read which of a dynamic kernel's models is in force.
    let dynamic = host.read("sys/kernel/debug/sched/preempt").and_then(|line| chosen(&line).map(str::to_owned));
    let fix = "boot with preempt=full, or install a PREEMPT_RT kernel";
    let model = match dynamic.as_deref() {
        _ if realtime => "realtime",
        Some(model) => model,
        None if version.contains("PREEMPT_DYNAMIC") => {
            let fix = "mount -t debugfs none /sys/kernel/debug, and look again as root";
            return it.unknown("dynamic; the model in force is not shown", fix);
        }
        None if version.contains("PREEMPT") => "full",
        None if version.is_empty() => return it.not_told("/proc"),
        None => "none",
    };
    match model {
        "realtime" | "full" | "lazy" => it.ok(model),
        _ => it.degraded(model, fix),
    }
}

pub(super) fn throttling(host: &Host) -> Check {
    let it = Subject("throttling", "past this share of the time the kernel stops realtime loops until the period ends");
    let runtime = host.number("proc/sys/kernel/sched_rt_runtime_us");
    let period = host.number("proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000);
    let fix = "sysctl -w kernel.sched_rt_runtime_us=950000";
    match runtime {
        Some(-1) => it.ok("off"),
        Some(0) => it.bad("realtime loops may not run at all", fix),
        Some(runtime) => {
            let share = runtime as f64 / period as f64;
            let found = format!("{runtime} of {period} µs");
            if share >= RUNTIME_WANTED { it.ok(found) } else { it.degraded(found, fix) }
        }
        None => it.not_told("/proc"),
    }
}
