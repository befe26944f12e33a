//! A host on which all is well, and every way to spoil it.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use tandem_cycle::setup::Granted;
use tempfile::TempDir;

use super::cell::CellFound;
use super::host::{Host, chosen, cpu_list};
use super::wake_up::WakeUp;
use super::*;

/// A host whose kernel tells what the test wants.
struct Fake {
    folder: TempDir,
    host: Host,
}

impl Fake {
    /// Files of a host on which every check is well.
    const WELL: [(&str, &str); 18] = [
        ("proc/self/cgroup", "0::/user.slice/cell\n"),
        ("sys/fs/cgroup/user.slice/cpu.max", "max 100000\n"),
        ("proc/loadavg", "0.40 0.5 0.6 1/99 1\n"),
        ("proc/stat", "cpu  50 0 0 50 0 0 0 0 0 0\ncpu0 1"),
        ("sys/devices/system/cpu/smt/active", "0\n"),
        ("sys/devices/system/cpu/isolated", "6-7\n"),
        ("proc/irq/24/smp_affinity_list", "0-5\n"),
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
        ("proc/cpuinfo", "flags\t\t: fpu constant_tsc nonstop_tsc\n"),
        ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
        ("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "2\n"),
        ("dev/cpu_dma_latency", ""),
        ("sys/kernel/debug/sched/preempt", "none voluntary [full]\n"),
        ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
        ("proc/meminfo", "MemTotal: 9000000 kB\nMemAvailable:    8000000 kB\n"),
        ("sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n"),
        ("proc/swaps", "Filename Type Size Used Priority\n"),
        ("proc/mounts", "tmpfs /dev/shm tmpfs rw,nosuid 0 0\n"),
    ];

    fn well() -> Self {
        let folder = TempDir::new().expect("a temporary directory");
        let found = || Some(Ok("as it should be".to_owned()));
        let host = Host {
            root: folder.path().to_owned(),
            processors: 8,
            resolution: Duration::from_nanos(1),
            granted: Some(Granted { priority: Some(80), ..Granted::default() }),
            lockable: None,
            open_files: Some(4_096),
            shared_free: Some(1 << 30),
            run_directory: Ok(PathBuf::from("/run/user/1/tandem")),
            dead_cells: Vec::new(),
            orphans: Vec::new(),
            state_folder: PathBuf::from("/state"),
            disk_free: Some(1 << 30),
            flush: Ok(Duration::from_millis(3)),
            cell: Some(CellFound { files: Ok("s471".to_owned()), model: found(), database: found() }),
            wake_up: Some(WakeUp { median: Duration::ZERO, p99: Duration::from_micros(90), missed: 0 }),
        };
        let fake = Self { folder, host };
        Self::WELL.iter().for_each(|(path, text)| fake.write(path, text));
        fake
    }

    fn write(&self, path: &str, text: &str) {
        let file = self.folder.path().join(path);
        fs::create_dir_all(file.parent().expect("a folder")).expect("writable");
        fs::write(file, text).expect("writable");
    }

    fn remove(&self, path: &str) {
        fs::remove_file(self.folder.path().join(path)).expect("it is there");
    }

    fn checks(&self) -> Vec<Check> {
        CHECKS.iter().map(|check| check(&self.host)).collect()
    }
}

/// One thing that is not well: the only check that sees it, how it judges, what it must say.
type Break = (&'static str, Verdict, &'static str, fn(&mut Fake));

const BREAKS: &[Break] = {
    use Verdict::{Bad, Degraded, Unknown};
    &[
        ("processors", Degraded, "2 available", |f| f.host.processors = 2),
        ("cpu_quota", Degraded, "1.50 processors", |f| {
            f.write("sys/fs/cgroup/user.slice/cell/cpu.max", "150000 100000")
        }),
        ("cpu_quota", Degraded, "0.50 processors", |f| {
            f.write("proc/self/cgroup", "4:cpu,cpuacct:/a\n");
            f.write("sys/fs/cgroup/cpu/a/cpu.cfs_quota_us", "50000");
            f.write("sys/fs/cgroup/cpu/a/cpu.cfs_period_us", "100000");
        }),
        ("load", Degraded, "12.0 over the last minute", |f| f.write("proc/loadavg", "12.0 3 3 1/9 1")),
        ("load", Unknown, "not told", |f| f.remove("proc/loadavg")),
        ("steal", Degraded, "1.00 % of the time", |f| f.write("proc/stat", "cpu  50 0 0 49 0 0 0 1 0 0\n")),
        ("steal", Unknown, "not told", |f| f.write("proc/stat", "nonsense")),
        ("siblings", Degraded, "two threads", |f| f.write("sys/devices/system/cpu/smt/active", "1")),
        ("isolation", Degraded, "none", |f| f.remove("sys/devices/system/cpu/isolated")),
        ("interrupts", Degraded, "24 on the isolated", |f| f.write("proc/irq/24/effective_affinity_list", "7\n")),
        ("clocksource", Degraded, "acpi_pm", |f| {
            f.write("sys/devices/system/clocksource/clocksource0/current_clocksource", "acpi_pm\n");
        }),
        ("clocksource", Unknown, "not told", |f| {
            f.remove("sys/devices/system/clocksource/clocksource0/current_clocksource");
        }),
        ("tsc", Degraded, "without nonstop_tsc", |f| f.write("proc/cpuinfo", "flags\t: constant_tsc\n")),
        ("timer_resolution", Bad, "4000000 ns", |f| f.host.resolution = Duration::from_millis(4)),
        ("governor", Degraded, "performance, powersave", |f| {
            f.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n");
        }),
        ("idle_states", Degraded, "down to C6, 133 µs", |f| {
            f.write("sys/devices/system/cpu/cpu1/cpuidle/state3/latency", "133\n");
            f.write("sys/devices/system/cpu/cpu1/cpuidle/state3/name", "C6\n");
        }),
        ("idle_request", Degraded, "/dev/cpu_dma_latency: ", |f| f.remove("dev/cpu_dma_latency")),
        ("preemption", Degraded, "voluntary", |f| f.write("sys/kernel/debug/sched/preempt", "none [voluntary] full")),
        ("preemption", Unknown, "dynamic", |f| {
            f.remove("sys/kernel/debug/sched/preempt");
            f.write("proc/version", "Linux version 6.18 #1 SMP PREEMPT_DYNAMIC");
        }),
        ("throttling", Degraded, "500000 of 1000000", |f| f.write("proc/sys/kernel/sched_rt_runtime_us", "500000")),
        ("throttling", Bad, "not run at all", |f| f.write("proc/sys/kernel/sched_rt_runtime_us", "0")),
        ("fifo", Degraded, "priority 80 was refused", |f| f.host.granted = Some(Granted::default())),
        ("timer_slack", Degraded, "50000 ns", |f| {
            f.host.granted = Some(Granted { priority: Some(80), timer_slack_ns: 50_000, ..Granted::default() });
        }),
        ("memory_lock", Degraded, "up to 8192 kB", |f| f.host.lockable = Some(8 << 20)),
        ("open_files", Bad, "256", |f| f.host.open_files = Some(256)),
        ("memory", Degraded, "100 MB available", |f| f.write("proc/meminfo", "MemAvailable: 102400 kB\n")),
        ("huge_pages", Degraded, "always", |f| {
            f.write("sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
        }),
        ("page_moving", Degraded, "NUMA balancing", |f| f.write("proc/sys/kernel/numa_balancing", "1\n")),
        ("page_moving", Degraded, "merging of equal pages", |f| f.write("sys/kernel/mm/ksm/run", "1\n")),
        ("page_moving", Degraded, "compaction of locked pages", |f| {
            f.write("proc/sys/vm/compact_unevictable_allowed", "1\n");
        }),
        ("swap", Degraded, "/dev/sda2, /swapfile", |f| {
            f.write("proc/swaps", "Filename Type\n/dev/sda2 partition 1 0 -2\n/swapfile file 1 0 -3\n");
        }),
        ("shared_memory", Bad, "16 MB free", |f| f.host.shared_free = Some(16 << 20)),
        ("shared_memory", Degraded, "32 MB free", |f| f.host.shared_free = Some(32 << 20)),
        ("shared_memory", Bad, "not mounted", |f| f.host.shared_free = None),
        ("shared_memory_mount", Bad, "reading only", |f| f.write("proc/mounts", "tmpfs /dev/shm tmpfs ro 0 0\n")),
        ("shared_memory_mount", Degraded, "ext4", |f| f.write("proc/mounts", "/dev/sda /dev/shm ext4 rw 0 0\n")),
        ("remove_ipc", Degraded, "RemoveIPC=yes", |f| f.write("run/systemd/system/x", "")),
        ("remove_ipc", Degraded, "RemoveIPC=true", |f| {
            f.write("run/systemd/system/x", "");
            f.write("etc/systemd/logind.conf", "[Login]\nRemoveIPC=no\n");
            f.write("etc/systemd/logind.conf.d/later.conf", "[Login]\nRemoveIPC=true\n");
        }),
        ("run_directory", Bad, "denied", |f| f.host.run_directory = Err("denied".to_owned())),
        ("leftovers", Degraded, "s471-1-aa", |f| f.host.dead_cells = vec!["s471-1-aa".to_owned()]),
        ("leftovers", Degraded, "s471-1-bb", |f| f.host.orphans = vec!["s471-1-bb".to_owned()]),
        ("disk", Degraded, "1 MB free in /state", |f| f.host.disk_free = Some(1 << 20)),
        ("disk", Unknown, "/state cannot", |f| f.host.disk_free = None),
        ("flush", Degraded, "80.0 ms", |f| f.host.flush = Ok(Duration::from_millis(80))),
        ("flush", Bad, "/state: no space", |f| f.host.flush = Err("no space".to_owned())),
        ("cell", Bad, "x.toml: no such file", |f| {
            f.host.cell.as_mut().expect("named").files = Err("x.toml: no such file".to_owned());
        }),
        ("model", Bad, "corrupted", |f| f.host.cell.as_mut().expect("named").model = Some(Err("corrupted".to_owned()))),
        ("model", Unknown, "do not say", |f| f.host.cell.as_mut().expect("named").model = None),
        ("database", Bad, "refused", |f| {
            f.host.cell.as_mut().expect("named").database = Some(Err("refused".to_owned()))
        }),
        ("wake_up", Degraded, "3 of 300 cycles missed", |f| f.host.wake_up.as_mut().expect("tried").missed = 3),
        ("wake_up", Unknown, "could not be run", |f| f.host.wake_up = None),
    ]
};

#[test]
fn on_a_host_without_fault_every_check_is_well() {
    for check in Fake::well().checks() {
        assert_eq!((check.verdict, check.fix), (Verdict::Ok, None), "{}: {}", check.name, check.found);
    }
}

/// Each fault is seen by its own check, with the right weight and a fix, and by no other.
#[test]
fn each_fault_is_seen_by_the_one_check_that_looks_for_it() {
    for (name, verdict, found, spoil) in BREAKS {
        let mut fake = Fake::well();
        spoil(&mut fake);
        for check in fake.checks() {
            let expected = if check.name == *name { *verdict } else { Verdict::Ok };
            assert_eq!(check.verdict, expected, "spoilt {name}: {check:?}");
            assert_eq!(check.fix.is_none(), check.verdict == Verdict::Ok, "spoilt {name}: {check:?}");
            assert!(check.name != *name || check.found.contains(found), "{check:?} does not say {found:?}");
        }
    }
}

/// No check that nothing breaks.
#[test]
fn every_check_has_a_fault_that_breaks_it() {
    let checks = Fake::well().checks();
    for check in &checks {
        assert!(BREAKS.iter().any(|(name, ..)| *name == check.name), "nothing breaks {}", check.name);
        assert_eq!(checks.iter().filter(|other| other.name == check.name).count(), 1, "{}", check.name);
    }
}

/// Of an unknown cell nothing can be said, and that is said.
#[test]
fn without_a_cell_its_checks_are_unknown() {
    let mut fake = Fake::well();
    fake.host.cell = None;
    let unknown: Vec<_> = fake.checks().into_iter().filter(|c| c.verdict == Verdict::Unknown).map(|c| c.name).collect();
    assert_eq!(unknown, ["cell", "model", "database"]);
}

/// The real host: something is found by every check, and every trouble has a fix.
#[test]
fn this_host_is_examined() {
    for check in examine(None) {
        assert_eq!(check.fix.is_none(), check.verdict == Verdict::Ok, "{check:?}");
        assert!(!check.found.is_empty(), "{check:?}");
    }
}

#[test]
fn a_trial_of_the_disk_leaves_no_file_and_names_what_refuses_it() {
    let folder = TempDir::new().expect("a temporary directory");
    assert!(storage::flush_time(folder.path()).is_ok());
    assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 0);
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    assert!(storage::flush_time(file.path()).is_err());
}

#[test]
fn the_kernels_lists_are_read() {
    assert_eq!(chosen("always [madvise] never"), Some("madvise"));
    assert_eq!(chosen("none"), None);
    assert_eq!(cpu_list("0-2,5\n"), [0, 1, 2, 5]);
    assert_eq!(cpu_list(""), [] as [u32; 0]);
}
