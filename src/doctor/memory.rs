//! Where memory comes from, and how fast.

use std::path::Path;

use super::{Check, Host, chosen};

/// A cell takes about 20 MB; two and some room.
const SHARED_WANTED: u64 = 64 << 20;
const SHARED_NEEDED: u64 = 24 << 20;

pub(super) fn huge_pages(host: &Host) -> Check {
    const NAME: &str = "huge_pages";
    let matters = "the kernel stops a process to merge its pages into large ones";
    let line = host.read("sys/kernel/mm/transparent_hugepage/enabled");
    match line.as_deref().and_then(chosen) {
        Some("always") => Check::degraded(
            NAME,
            "always",
            matters,
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled, or boot with transparent_hugepage=madvise",
        ),
        Some(other) => Check::ok(NAME, other, matters),
        None => Check::ok(NAME, "the kernel has none", matters),
    }
}

pub(super) fn swap(host: &Host) -> Check {
    const NAME: &str = "swap";
    let matters = "memory that was swapped out is fetched from disk in the middle of a cycle";
    let Some(table) = host.read("proc/swaps") else {
        return Check::ok(NAME, "none", matters);
    };
    let devices: Vec<&str> = table.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if devices.is_empty() {
        Check::ok(NAME, "none", matters)
    } else {
        let fix = "swapoff -a, or see to it that memory may be locked (memory_lock)";
        Check::degraded(NAME, devices.join(", "), matters, fix)
    }
}

pub(super) fn shared_memory(mount: &Path) -> Check {
    const NAME: &str = "shared_memory";
    let matters = "all messages of a cell lie here; when it is full, processes die of SIGBUS";
    let Ok(space) = rustix::fs::statvfs(mount) else {
        let fix = "mount -t tmpfs tmpfs /dev/shm";
        return Check::failed(NAME, format!("{} is not mounted", mount.display()), matters, fix);
    };
    judge_space(space.f_bavail.saturating_mul(space.f_frsize), matters)
}

fn judge_space(free: u64, matters: &'static str) -> Check {
    const NAME: &str = "shared_memory";
    let found = format!("{} MB free", free >> 20);
    let fix = "mount -o remount,size=256M /dev/shm; in a container: --shm-size 256m";
    if free >= SHARED_WANTED {
        Check::ok(NAME, found, matters)
    } else if free >= SHARED_NEEDED {
        Check::degraded(NAME, found, matters, fix)
    } else {
        Check::failed(NAME, found, matters, fix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;
    use crate::doctor::tests::FakeHost;

    #[test]
    fn pages_merged_behind_our_back_are_named() {
        const FILE: &str = "sys/kernel/mm/transparent_hugepage/enabled";
        let judged = |text| huge_pages(&FakeHost::new().with(FILE, text).host()).verdict;
        assert_eq!(judged("[always] madvise never"), Verdict::Degraded);
        assert_eq!(judged("always [madvise] never"), Verdict::Ok);
    }

    #[test]
    fn swap_devices_are_listed() {
        let table = "Filename Type Size Used Priority\n/dev/sda2 partition 1 0 -2\n/swapfile file 1 0 -3\n";
        let check = swap(&FakeHost::new().with("proc/swaps", table).host());
        assert_eq!((check.verdict, check.found.as_str()), (Verdict::Degraded, "/dev/sda2, /swapfile"));
        let none = FakeHost::new().with("proc/swaps", "Filename Type Size Used Priority\n");
        assert_eq!(swap(&none.host()).verdict, Verdict::Ok);
    }

    #[test]
    fn too_little_shared_memory_is_a_failure() {
        assert_eq!(judge_space(16 << 20, "").verdict, Verdict::Failed);
        assert_eq!(judge_space(32 << 20, "").verdict, Verdict::Degraded);
        assert_eq!(judge_space(1 << 30, "").found, "1024 MB free");
        assert_eq!(shared_memory(Path::new("/no/such/mount")).verdict, Verdict::Failed);
    }
}
