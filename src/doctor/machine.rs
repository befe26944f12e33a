//! Clocks, and how fast the processors run.

use std::time::Duration;

use super::{Check, Host, Subject};

const CLOCKS: [&str; 5] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "xen"];

pub(super) fn clocksource(host: &Host) -> Check {
    let it = Subject("clocksource", "each cycle reads the clock several times");
    match host.read("sys/devices/system/clocksource/clocksource0/current_clocksource") {
        Some(clock) if CLOCKS.contains(&clock.as_str()) => it.ok(clock),
        Some(clock) => it.degraded(
            clock,
            "this clock is slow to read: boot with clocksource=tsc tsc=reliable if the processor's counter is stable",
        ),
        None => it.not_told("/sys"),
    }
}

/// On x86 the clock is only as good as the processor's counter.
pub(super) fn tsc(host: &Host) -> Check {
    let it = Subject("tsc", "a counter that changes its rate, or stops when idle, moves the loops' deadlines");
    let Some(text) = host.read("proc/cpuinfo") else { return it.not_told("/proc") };
    let Some(flags) = text.lines().find_map(|line| line.strip_prefix("flags")) else {
        return it.ok("not a processor of the x86 kind");
    };
    let lacks: Vec<&str> = ["constant_tsc", "nonstop_tsc"]
        .into_iter()
        .filter(|want| !flags.split_whitespace().any(|f| f == *want))
        .collect();
    if lacks.is_empty() {
        it.ok("constant, does not stop")
    } else {
        it.degraded(
            format!("without {}", lacks.join(", ")),
            "on a virtual machine let the hypervisor pass the processor's invariant counter on; else choose newer hardware",
        )
    }
}

pub(super) fn timer_resolution(host: &Host) -> Check {
    let it = Subject("timer_resolution", "the loops wake at instants on a grid of 50 µs and more");
    let found = format!("{} ns", host.resolution.as_nanos());
    if host.resolution <= Duration::from_micros(1) {
        it.ok(found)
    } else {
        it.bad(found, "boot a kernel with CONFIG_HIGH_RES_TIMERS, without highres=off")
    }
}

pub(super) fn governor(host: &Host) -> Check {
    const CPUS: &str = "sys/devices/system/cpu";
    let it = Subject("governor", "a processor that has slowed down wakes late and computes slowly");
    let mut governors: Vec<String> = host
        .list(CPUS)
        .into_iter()
        .filter_map(|cpu| host.read(&format!("{CPUS}/{cpu}/cpufreq/scaling_governor")))
        .collect();
    governors.sort();
    governors.dedup();
    match governors.join(", ") {
        none if none.is_empty() => it.ok("the kernel does not change the frequency"),
        performance if performance == "performance" => it.ok(performance),
        other => it.degraded(other, "cpupower frequency-set -g performance"),
    }
}
