//! Processors: how many, whole or shared, and with what.

use super::host::cpu_list;
use super::{Check, Host, Subject};

/// Two realtime loops, perception and the supervisor, each with a processor.
const WANTED: usize = 4;
/// Share of time a hypervisor may take before it is felt at a millisecond.
const STEAL_MAX: f64 = 0.005;

pub(super) fn count(host: &Host) -> Check {
    let it = Subject("processors", "plant and controller run a cycle each in every millisecond, beside perception");
    let found = format!("{} available", host.processors);
    if host.processors >= WANTED {
        it.ok(found)
    } else {
        it.degraded(found, format!("give the cell {WANTED} processors, or expect late cycles when all roles are busy"))
    }
}

/// A quota stops every thread of a group until the period ends, realtime threads with them.
pub(super) fn quota(host: &Host) -> Check {
    let it = Subject("cpu_quota", "a group that has used up its quota stands still for tens of milliseconds");
    let groups = host.read("proc/self/cgroup").unwrap_or_default();
    // Version 2 names one group, version 1 the one of its `cpu` controller.
    let v2 = groups.lines().find_map(|line| line.strip_prefix("0::"));
    let v1 = groups.lines().find_map(|line| line.split_once(":cpu,cpuacct:").or(line.split_once(":cpu:")));
    let v2 = ancestors(v2).filter_map(|group| {
        let text = host.read(&format!("sys/fs/cgroup{group}/cpu.max"))?;
        let (quota, period) = text.split_once(' ')?;
        Some((quota.parse::<f64>().ok()?, period.parse::<f64>().ok()?))
    });
    let v1 = ancestors(v1.map(|(_, group)| group)).filter_map(|group| {
        let number = |file| host.number(&format!("sys/fs/cgroup/cpu{group}/{file}"));
        // -1 is no quota.
        let quota = number("cpu.cfs_quota_us").filter(|quota| *quota > 0)?;
        Some((quota as f64, number("cpu.cfs_period_us")? as f64))
    });
    let least = v2.chain(v1).map(|(quota, period)| quota / period).min_by(f64::total_cmp);
    match least {
        None => it.ok("none"),
        Some(share) => it.degraded(
            format!("{share:.2} processors"),
            "start the container without --cpus, the service without CPUQuota=; bind it to processors instead",
        ),
    }
}

/// A control group and all above it, without the slash at the end.
fn ancestors(group: Option<&str>) -> impl Iterator<Item = String> {
    let whole = group.map(|group| group.trim_end_matches('/').to_owned());
    std::iter::successors(whole, |group| Some(group.rsplit_once('/')?.0.to_owned()))
}

pub(super) fn load(host: &Host) -> Check {
    let it = Subject("load", "what else runs takes processors and caches from the roles that are not realtime");
    let average = host.read("proc/loadavg").and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    match average {
        None => it.not_told("/proc"),
        Some(average) => {
            let found = format!("{average:.1} over the last minute, {} processors", host.processors);
            if average <= host.processors as f64 {
                it.ok(found)
            } else {
                it.degraded(found, "stop what else runs on this machine, see `top`")
            }
        }
    }
}

pub(super) fn steal(host: &Host) -> Check {
    let it = Subject("steal", "what a hypervisor takes is missing in a cycle, and nothing here can prevent it");
    let Some(share) = host.read("proc/stat").as_deref().and_then(stolen) else {
        return it.not_told("/proc");
    };
    let found = format!("{:.2} % of the time since boot", share * 100.0);
    if share <= STEAL_MAX {
        it.ok(found)
    } else {
        it.degraded(found, "run on bare metal, or on a virtual machine with dedicated processors")
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

pub(super) fn siblings(host: &Host) -> Check {
    let it = Subject("siblings", "two threads of one core take each other's caches and execution units");
    match host.read("sys/devices/system/cpu/smt/active").as_deref() {
        Some("1") => it.degraded(
            "each core runs two threads at once",
            "echo off > /sys/devices/system/cpu/smt/control, or boot with nosmt; or isolate both threads of a core",
        ),
        Some(_) => it.ok("one thread a core"),
        None => it.ok("the kernel knows of none"),
    }
}

fn isolated(host: &Host) -> Vec<u32> {
    cpu_list(&host.read("sys/devices/system/cpu/isolated").unwrap_or_default())
}

pub(super) fn isolation(host: &Host) -> Check {
    let it = Subject("isolation", "on a processor of its own a loop is delayed by nobody");
    let isolated = isolated(host);
    if !isolated.is_empty() {
        it.ok(format!("processors {isolated:?} are isolated"))
    } else if host.processors < WANTED {
        it.ok(format!("none, and with {} processors none can be spared", host.processors))
    } else {
        let last = host.processors - 1;
        it.degraded(
            "none",
            format!(
                "boot with isolcpus={}-{last} nohz_full={}-{last}, and name them as realtime.cpus in the cell file",
                last - 1,
                last - 1
            ),
        )
    }
}

/// Interrupts must stay away from the processors that were set aside.
pub(super) fn interrupts(host: &Host) -> Check {
    const IRQ: &str = "proc/irq";
    let it = Subject("interrupts", "an interrupt delays the loop it meets, also a loop of the highest priority");
    let isolated = isolated(host);
    let numbers = host.list(IRQ).into_iter().filter(|name| name.parse::<u32>().is_ok());
    let meets = |number: &String| {
        let file = |name| host.read(&format!("{IRQ}/{number}/{name}")).filter(|text| !text.is_empty());
        let served = file("effective_affinity_list").or_else(|| file("smp_affinity_list"));
        served.is_some_and(|served| cpu_list(&served).iter().any(|cpu| isolated.contains(cpu)))
    };
    let meeting: Vec<String> = numbers.filter(meets).collect();
    if isolated.is_empty() {
        it.ok("no processor is set aside for the loops")
    } else if meeting.is_empty() {
        it.ok("none on the isolated processors")
    } else {
        let fix =
            "echo LIST > /proc/irq/N/smp_affinity_list with the other processors; stop irqbalance, or ban them there";
        it.degraded(format!("{} on the isolated processors", meeting.join(", ")), fix)
    }
}
