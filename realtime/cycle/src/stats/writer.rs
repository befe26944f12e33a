//! The loop's end.

use core::borrow::Borrow;
use core::sync::atomic::{Ordering, fence};
use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use tandem_msg::{Coded, Role, Stamp};

use super::mapping::Mapping;
use super::page::{Earlier, Guarded, LAYOUT, Page};
use crate::setup::Granted;
use crate::{Grid, Record, SharedRecord};

/// Writes the statistics of one incarnation of a role.
pub struct Writer {
    page: Mapping,
}

impl Writer {
    /// Opens the file of a role, or makes it, and begins the record of a new incarnation, which started at `now`.
    /// `inputs` are the names under which [`Writer::age`] counts, at most [`super::INPUTS_MAX`].
    ///
    /// # Errors
    /// The file cannot be made or mapped.
    pub fn create(
        path: &Path,
        role: Role,
        epoch: u64,
        grid: &Grid,
        inputs: &[&str],
        granted: &Granted,
        now: Stamp,
    ) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)?;
        file.set_len(size_of::<Page>() as u64)?;
        let page = Mapping::of(&file, true)?;
        let epoch_before = page.epoch.swap(0, Ordering::Relaxed);
        fence(Ordering::Release);
        let mut earlier = page.earlier.get();
        if epoch_before != 0 && page.layout.get() == LAYOUT {
            let mut last = Record::default();
            page.record.copy_to(&mut last);
            earlier = Earlier {
                incarnations: earlier.incarnations + 1,
                cycles: earlier.cycles + last.cycles,
                missed: earlier.missed + last.missed,
                overruns: earlier.overruns + last.overruns,
                stops: earlier.stops + last.stops,
            };
        }
        page.earlier.set(&earlier);
        page.layout.set(LAYOUT);
        page.role.set(role.code().into());
        page.pid.set(std::process::id().into());
        page.started.set(now.0);
        page.period_ns.set(grid.period().as_nanos() as u64);
        page.phase_ns.set(grid.phase().as_nanos() as u64);
        page.record.clear();
        page.guarded.set(&Guarded::default());
        let names = inputs.iter().copied().chain(core::iter::repeat(""));
        for (input, name) in page.inputs.iter().zip(names) {
            input.name.set(name);
            input.age.clear();
        }
        let writer = Self { page };
        writer.obtained(granted);
        writer.page.epoch.store(epoch.max(1), Ordering::Release);
        Ok(writer)
    }

    fn obtained(&self, granted: &Granted) {
        let words = &self.page.obtained;
        words.priority.set_optional(granted.priority.map(u64::from));
        words.cpu.set_optional(granted.cpu.map(u64::from));
        words.locked.set(granted.locked.into());
        words.prefaulted.set(granted.prefaulted);
        words.dma_latency_us.set_optional(granted.dma_latency_us);
        words.timer_slack_ns.set(granted.timer_slack_ns);
        words.notices.set(&granted.notices.to_string());
    }

    /// Counts how old an input was when a cycle began, nanoseconds.
    ///
    /// # Realtime
    /// Constant time; no system call.
    pub fn age(&self, input: usize, age_ns: u64) {
        if let Some(input) = self.page.inputs.get(input) {
            input.age.record(age_ns);
        }
    }

    /// Says what the loop has asked of the system since it was warm.
    pub fn guarded(&self, guarded: &Guarded) {
        self.page.guarded.set(guarded);
    }
}

impl Borrow<SharedRecord> for Writer {
    fn borrow(&self) -> &SharedRecord {
        &self.page.record
    }
}
