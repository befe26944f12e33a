//! cyclictest of rt-tests, the usual measure of a host's wake-up lateness, when it is installed.

use std::io::ErrorKind;
use std::process::Command;
use std::time::Duration;

use hdrhistogram::Histogram;

use super::BenchError;
use super::loops::PRIORITY;
use super::series::histogram;

/// What is said when it is not there.
pub(super) const ABSENT: &str = "cyclictest is not installed, so that baseline is absent: apt install rt-tests";
/// Longest lateness it counts one by one, microseconds.
const BUCKETS_US: u64 = 20_000;

/// One run: absolute deadlines on CLOCK_MONOTONIC, one thread under SCHED_FIFO, memory locked. `None` when it is not installed.
///
/// # Errors
/// It fails, which without realtime permission it does.
pub(super) fn run(period: Duration, time: Duration, cpu: Option<u32>) -> Result<Option<Histogram<u64>>, BenchError> {
    let cycles = (time.as_nanos() / period.as_nanos()).max(1);
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--mlockall", "--threads=1", &format!("--priority={PRIORITY}")]);
    command.arg(format!("--interval={}", period.as_micros()));
    command.arg(format!("--loops={cycles}"));
    command.arg(format!("--histogram={BUCKETS_US}"));
    if let Some(cpu) = cpu {
        command.arg(format!("--affinity={cpu}"));
    }
    let output = match command.output() {
        Err(cause) if cause.kind() == ErrorKind::NotFound => return Ok(None),
        output => output.map_err(BenchError::io("cyclictest"))?,
    };
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Err(BenchError::peer("cyclictest", format!("{}: {said}", output.status)));
    }
    Ok(Some(read(&String::from_utf8_lossy(&output.stdout))))
}

/// Its histogram: lines of lateness in whole microseconds and count. Each is taken at the middle of its microsecond;
/// what overflowed is counted at the maximum it reports.
fn read(text: &str) -> Histogram<u64> {
    let mut lateness = histogram();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut fields = line.split_whitespace().flat_map(str::parse::<u64>);
        if let (Some(microseconds), Some(count)) = (fields.next(), fields.next()) {
            lateness.saturating_record_n(microseconds * 1_000 + 500, count);
        }
    }
    let of = |mark: &str| text.lines().find_map(|line| line.strip_prefix(mark)?.trim().parse::<u64>().ok());
    if let (Some(count), Some(max)) = (of("# Histogram Overflows:"), of("# Max Latencies:")) {
        lateness.saturating_record_n(max * 1_000 + 500, count);
    }
    lateness
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As cyclictest 2.4 prints it.
    #[test]
    fn its_histogram_is_read_with_what_overflowed() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000021 000003\n000022 000006\n\
                    # Min Latencies: 00021\n# Avg Latencies: 00023\n# Max Latencies: 30123\n\
                    # Histogram Overflows: 00001\n# Histogram Overflow at cycle number:\n# Thread 0: 00007\n";
        let lateness = read(text);
        assert_eq!(lateness.len(), 10);
        assert_eq!(lateness.value_at_quantile(0.3) / 100, 215);
        assert_eq!(lateness.max() / 100_000, 301);
    }
}
