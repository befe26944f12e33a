//! How the kernel lets a realtime loop interrupt it.

use super::{Check, Host, chosen};

/// Share of each period realtime loops must be allowed.
const RUNTIME_WANTED: f64 = 0.9;

pub(super) fn preemption(host: &Host) -> Check {
    const NAME: &str = "preemption";
    let matters = "until it can be interrupted, the kernel delays the wake-up of a loop";
    let version = host.read("proc/version").unwrap_or_default();
    let realtime = host.read("sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT");
    // Only root may read which of a dynamic kernel's models is in force.
    let dynamic = host.read("sys/kernel/debug/sched/preempt").and_then(|line| chosen(&line).map(str::to_owned));
    let model = match dynamic.as_deref() {
        _ if realtime => "realtime",
        Some(model) => model,
        None if version.contains("PREEMPT_DYNAMIC") => {
            "dynamic, the model in force is not shown (mount debugfs, be root)"
        }
        None if version.contains("PREEMPT") => "full",
        None => "none",
    };
    match model {
        "realtime" | "full" | "lazy" => Check::ok(NAME, model, matters),
        _ => Check::degraded(NAME, model, matters, "boot with preempt=full, or install a PREEMPT_RT kernel"),
    }
}

pub(super) fn throttling(host: &Host) -> Check {
    const NAME: &str = "throttling";
    let matters = "past this share of the time the kernel stops realtime loops for the rest of the period";
    let runtime = host.number("proc/sys/kernel/sched_rt_runtime_us");
    let period = host.number("proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000);
    let fix = "sysctl -w kernel.sched_rt_runtime_us=950000";
    match runtime {
        Some(-1) => Check::ok(NAME, "off", matters),
        Some(0) => Check::failed(NAME, "realtime loops may not run at all", matters, fix),
        Some(runtime) => {
            let share = runtime as f64 / period as f64;
            let found = format!("{runtime} of {period} µs");
            if share >= RUNTIME_WANTED {
                Check::ok(NAME, found, matters)
            } else {
                Check::degraded(NAME, found, matters, fix)
            }
        }
        None => Check::degraded(NAME, "not told by the kernel", matters, "mount /proc"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;
    use crate::doctor::tests::FakeHost;

    #[test]
    fn the_model_in_force_decides_not_the_one_compiled_in() {
        let dynamic = FakeHost::new().with("proc/version", "Linux version 6.18 #1 SMP PREEMPT_DYNAMIC");
        assert_eq!(preemption(&dynamic.host()).verdict, Verdict::Degraded);
        let none = dynamic.with("sys/kernel/debug/sched/preempt", "(none) [voluntary] full");
        assert_eq!(preemption(&none.host()).found, "voluntary");
        let full = none.with("sys/kernel/debug/sched/preempt", "none voluntary [full]");
        assert_eq!(preemption(&full.host()).verdict, Verdict::Ok);
        let realtime = FakeHost::new().with("proc/version", "Linux version 6.18 #1 SMP PREEMPT_RT");
        assert_eq!(preemption(&realtime.host()).found, "realtime");
        assert_eq!(preemption(&FakeHost::new().host()).verdict, Verdict::Degraded);
    }

    #[test]
    fn a_kernel_that_forbids_realtime_is_a_failure() {
        let judged = |text| throttling(&FakeHost::new().with("proc/sys/kernel/sched_rt_runtime_us", text).host());
        assert_eq!(judged("950000").verdict, Verdict::Ok);
        assert_eq!(judged("-1").verdict, Verdict::Ok);
        assert_eq!(judged("500000").verdict, Verdict::Degraded);
        assert_eq!(judged("0").verdict, Verdict::Failed);
    }
}
