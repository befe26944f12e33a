//! Where memory comes from, how fast, and whether it stays.

use super::host::chosen;
use super::{Check, Host, Subject};

/// A cell takes about 20 MB of shared memory; two and some room.
const SHARED_WANTED: u64 = 64 << 20;
const SHARED_NEEDED: u64 = 24 << 20;
/// The four processes of a cell take about half of this, kB.
const AVAILABLE_WANTED: u64 = 1 << 20;

pub(super) fn available(host: &Host) -> Check {
    let it = Subject("memory", "when memory runs out the kernel ends a process, and it may be the controller");
    let text = host.read("proc/meminfo").unwrap_or_default();
    let kilobytes = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    match kilobytes.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok()) {
        None => it.not_told("/proc"),
        Some(kilobytes) => {
            let found = format!("{} MB available", kilobytes >> 10);
            if kilobytes >= AVAILABLE_WANTED {
                it.ok(found)
            } else {
                it.degraded(found, "end other programs, or add memory")
            }
        }
    }
}

pub(super) fn huge_pages(host: &Host) -> Check {
    let it = Subject("huge_pages", "the kernel stops a process to merge its pages into large ones");
    let line = host.read("sys/kernel/mm/transparent_hugepage/enabled");
    match line.as_deref().and_then(chosen) {
        Some("always") => it.degraded(
            "always",
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled, or boot with transparent_hugepage=madvise",
        ),
        Some(other) => it.ok(other),
        None => it.ok("the kernel has none"),
    }
}

/// Balancing between memories, merging of equal pages and compaction take pages away while a loop uses them; the last
/// also pages that are locked.
pub(super) fn page_moving(host: &Host) -> Check {
    let it = Subject("page_moving", "a page that the kernel moves or merges faults when a loop touches it next");
    let is_on = |path| host.number(path).is_some_and(|on| on != 0);
    let movers = [
        (is_on("proc/sys/kernel/numa_balancing"), "NUMA balancing", "sysctl -w kernel.numa_balancing=0"),
        (host.number("sys/kernel/mm/ksm/run") == Some(1), "merging of equal pages", "echo 2 > /sys/kernel/mm/ksm/run"),
        (
            is_on("proc/sys/vm/compact_unevictable_allowed"),
            "compaction of locked pages",
            "sysctl -w vm.compact_unevictable_allowed=0",
        ),
    ];
    let active = || movers.iter().filter(|(active, ..)| *active);
    let what: Vec<&str> = active().map(|(_, what, _)| *what).collect();
    let fixes: Vec<&str> = active().map(|(.., fix)| *fix).collect();
    if what.is_empty() { it.ok("none") } else { it.degraded(what.join(", "), fixes.join("; ")) }
}

pub(super) fn swap(host: &Host) -> Check {
    let it = Subject("swap", "memory that was swapped out is fetched from disk in the middle of a cycle");
    let table = host.read("proc/swaps").unwrap_or_default();
    let devices: Vec<&str> = table.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if devices.is_empty() {
        it.ok("none")
    } else {
        it.degraded(devices.join(", "), "swapoff -a, or see to it that memory may be locked (memory_lock)")
    }
}

pub(super) fn shared_memory(host: &Host) -> Check {
    let it = Subject("shared_memory", "all messages of a cell lie here; when it is full, processes die of SIGBUS");
    let Some(free) = host.shared_free else {
        return it.bad("/dev/shm is not mounted", "mount -t tmpfs tmpfs /dev/shm");
    };
    let found = format!("{} MB free", free >> 20);
    let fix = "mount -o remount,size=256M /dev/shm; in a container: --shm-size 256m";
    if free >= SHARED_WANTED {
        it.ok(found)
    } else if free >= SHARED_NEEDED {
        it.degraded(found, fix)
    } else {
        it.bad(found, fix)
    }
}

pub(super) fn shared_memory_mount(host: &Host) -> Check {
    let it = Subject("shared_memory_mount", "messages on a disk would be written back to it while a loop waits");
    let mounts = host.read("proc/mounts").unwrap_or_default();
    // A later mount hides an earlier one.
    let mount = mounts.lines().rev().find_map(|line| {
        let mut fields = line.split_whitespace().skip(1);
        (fields.next()? == "/dev/shm").then(|| (fields.next().unwrap_or_default(), fields.next().unwrap_or_default()))
    });
    let fix = "mount -t tmpfs -o rw,nosuid,nodev tmpfs /dev/shm";
    match mount {
        Some((_, options)) if options.split(',').any(|option| option == "ro") => {
            it.bad("mounted for reading only", fix)
        }
        Some(("tmpfs", _)) => it.ok("tmpfs"),
        Some((kind, _)) => it.degraded(kind, fix),
        None if mounts.is_empty() => it.not_told("/proc"),
        None => it.degraded("no mount of its own", fix),
    }
}

/// systemd's log-in manager removes a user's shared memory when they log out, unless told otherwise.
pub(super) fn remove_ipc(host: &Host) -> Check {
    let it = Subject("remove_ipc", "systemd may delete the shared memory of a running cell when its user logs out");
    if !host.root.join("run/systemd/system").is_dir() {
        return it.ok("systemd does not run here");
    }
    let drop_ins =
        host.list("etc/systemd/logind.conf.d").into_iter().map(|name| format!("etc/systemd/logind.conf.d/{name}"));
    let files = std::iter::once("etc/systemd/logind.conf".to_owned()).chain(drop_ins);
    let text: String = files.filter_map(|file| host.read(&file)).fold(String::new(), |all, text| all + &text + "\n");
    // What is said last holds.
    match text.lines().rev().find_map(|line| line.trim().strip_prefix("RemoveIPC=")) {
        Some("no" | "false" | "0" | "off") => it.ok("RemoveIPC=no"),
        said => it.degraded(
            format!("RemoveIPC={}", said.unwrap_or("yes, as no file says otherwise")),
            "set RemoveIPC=no in /etc/systemd/logind.conf and restart systemd-logind; or run the cell as a system user",
        ),
    }
}
