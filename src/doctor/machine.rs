//! Processors, clocks and their frequency.

use rustix::time::{ClockId, clock_getres};

use super::{Check, Host};

/// Two realtime loops, perception and the supervisor, each with a processor.
const PROCESSORS_WANTED: usize = 4;
const CLOCKS: [&str; 5] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "xen"];
/// Share of time a hypervisor may take before it is felt at a millisecond.
const STEAL_MAX: f64 = 0.005;

pub(super) fn processors() -> Check {
    let matters = "plant and controller run a cycle each in every millisecond, beside perception";
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    let found = format!("{count} available");
    if count >= PROCESSORS_WANTED {
        Check::ok("processors", found, matters)
    } else {
        Check::degraded(
            "processors",
            found,
            matters,
            format!("give the cell {PROCESSORS_WANTED} processors, or expect late cycles when all roles are busy"),
        )
    }
}

pub(super) fn clocksource(host: &Host) -> Check {
    const NAME: &str = "clocksource";
    let matters = "each cycle reads the clock several times";
    match host.read("sys/devices/system/clocksource/clocksource0/current_clocksource") {
        Some(clock) if CLOCKS.contains(&clock.as_str()) => Check::ok(NAME, clock, matters),
        Some(clock) => Check::degraded(
            NAME,
            clock,
            matters,
            "this clock is slow to read: boot with clocksource=tsc tsc=reliable if the processor's counter is stable",
        ),
        None => Check::degraded(NAME, "not told by the kernel", matters, "mount /sys"),
    }
}

pub(super) fn timer_resolution() -> Check {
    let matters = "the loops wake at instants on a grid of 50 µs and more";
    let resolution = clock_getres(ClockId::Monotonic);
    let found = format!("{} ns", resolution.tv_nsec);
    if resolution.tv_sec == 0 && resolution.tv_nsec <= 1_000 {
        Check::ok("timer_resolution", found, matters)
    } else {
        Check::failed("timer_resolution", found, matters, "boot a kernel with CONFIG_HIGH_RES_TIMERS, without nohrt")
    }
}

pub(super) fn governor(host: &Host) -> Check {
    const NAME: &str = "governor";
    const CPUS: &str = "sys/devices/system/cpu";
    let matters = "a processor that has slowed down wakes late and computes slowly";
    let mut governors: Vec<String> = host
        .list(CPUS)
        .into_iter()
        .filter_map(|cpu| host.read(&format!("{CPUS}/{cpu}/cpufreq/scaling_governor")))
        .collect();
    governors.sort();
    governors.dedup();
    match governors.join(", ") {
        none if none.is_empty() => Check::ok(NAME, "the kernel does not change the frequency", matters),
        performance if performance == "performance" => Check::ok(NAME, performance, matters),
        other => Check::degraded(NAME, other, matters, "cpupower frequency-set -g performance"),
    }
}

pub(super) fn steal(host: &Host) -> Check {
    const NAME: &str = "steal";
    let matters = "what a hypervisor takes is missing in a cycle, and nothing here can prevent it";
    let Some(share) = host.read("proc/stat").as_deref().and_then(stolen) else {
        return Check::degraded(NAME, "not told by the kernel", matters, "mount /proc");
    };
    let found = format!("{:.2} % of the time since boot", share * 100.0);
    if share <= STEAL_MAX {
        Check::ok(NAME, found, matters)
    } else {
        Check::degraded(NAME, found, matters, "run on bare metal, or on a virtual machine with dedicated processors")
    }
}

/// Share of the time a hypervisor took: the eighth number of `cpu` in /proc/stat.
fn stolen(stat: &str) -> Option<f64> {
    let times: Vec<f64> =
        stat.lines().find_map(|line| line.strip_prefix("cpu "))?.split_whitespace().flat_map(str::parse).collect();
    // guest times are part of user and nice
    let total: f64 = times.get(..8)?.iter().sum();
    (total > 0.0).then(|| times[7] / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;
    use crate::doctor::tests::FakeHost;

    #[test]
    fn a_slow_clock_is_named() {
        const FILE: &str = "sys/devices/system/clocksource/clocksource0/current_clocksource";
        let judged = |clock| clocksource(&FakeHost::new().with(FILE, clock).host());
        assert_eq!(judged("tsc\n").verdict, Verdict::Ok);
        assert_eq!((judged("acpi_pm\n").verdict, judged("acpi_pm\n").found), (Verdict::Degraded, "acpi_pm".to_owned()));
        assert_eq!(clocksource(&FakeHost::new().host()).verdict, Verdict::Degraded);
    }

    #[test]
    fn one_saving_processor_is_enough() {
        let host = FakeHost::new()
            .with("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n")
            .with("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n");
        let check = governor(&host.host());
        assert_eq!((check.verdict, check.found.as_str()), (Verdict::Degraded, "performance, powersave"));
        assert_eq!(governor(&FakeHost::new().host()).verdict, Verdict::Ok);
    }

    #[test]
    fn stolen_time_is_a_share_of_all() {
        let judged = |line| steal(&FakeHost::new().with("proc/stat", line).host());
        assert_eq!(judged("cpu  50 0 0 49 0 0 0 1 0 0\ncpu0 1").verdict, Verdict::Degraded);
        assert_eq!(judged("cpu  50 0 0 50 0 0 0 0 50 0\n").found, "0.00 % of the time since boot");
        assert_eq!(judged("nonsense").verdict, Verdict::Degraded);
    }
}
