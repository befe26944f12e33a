//! The feeder: clears the fixture, brings parts to their stations, lets the camera look.

use core::time::Duration;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rapier3d_f64::prelude::PhysicsWorld;
use tandem_config::pose_of;
use tandem_msg::{CellRequest, Pose, RequestKind, RequestPhase, Stamp};

use super::parts::{Parts, Place};

/// Scans of a presented part per request. One is enough: the sample waits for whoever
/// comes late, and a second look is asked for by `Rescan`.
const SCANS: u32 = 1;
/// Bringing a part takes up to this share longer than its mean, and as much shorter.
const PRESENT_SPREAD: f64 = 0.15;

/// How the feeder works.
#[derive(Clone, Debug)]
pub(super) struct FeederModel {
    /// Carriers, by index.
    pub(super) base_from_station: Vec<Isometry3<f64>>,
    /// Spread of a part in the plane of its carrier: metres, radians (standard deviations; the carrier's stops cut at two).
    pub(super) jitter: (f64, f64),
    /// Seconds to bring an empty fixture.
    pub(super) new_box: f64,
    /// Seconds to bring a part.
    pub(super) present: f64,
    /// Seconds from a part standing still to its scan.
    pub(super) scan: f64,
    /// Scans fall on multiples of this.
    pub(super) scan_period: Duration,
}

/// The feeder and what it was asked last.
pub(super) struct Feeder {
    model: FeederModel,
    request: CellRequest,
    phase: RequestPhase,
    ready_at: Stamp,
    presented: Option<usize>,
    presented_by: u32,
    scans_left: u32,
    scan_from: Stamp,
    base_from_station: Pose,
    presentations: u32,
}

impl Feeder {
    /// A feeder with nothing on its carriers.
    pub(super) fn new(model: FeederModel) -> Self {
        Self {
            model,
            request: CellRequest::default(),
            phase: RequestPhase::Idle,
            ready_at: Stamp(0),
            presented: None,
            presented_by: 0,
            scans_left: 0,
            scan_from: Stamp(0),
            base_from_station: Pose::IDENTITY,
            presentations: 0,
        }
    }

    /// Takes up a new request and serves it when its time has come.
    pub(super) fn cycle(
        &mut self,
        now: Stamp,
        request: &CellRequest,
        parts: &mut Parts,
        world: &mut PhysicsWorld,
        random: &mut ChaCha8Rng,
    ) {
        if request.header.heard() && request.id != 0 && request.id != self.request.id {
            self.request = *request;
            self.begin(now, random);
        }
        if self.phase == RequestPhase::Busy && now >= self.ready_at {
            self.scan_from = now.after(Duration::from_secs_f64(self.model.scan));
            self.phase = if self.serve(parts, world, random) { RequestPhase::Served } else { RequestPhase::Failed };
        }
        if self.presented.is_some_and(|part| parts.place(part) != Place::Station) {
            self.presented = None;
            self.presented_by = 0;
            self.scans_left = 0;
        }
    }

    fn begin(&mut self, now: Stamp, random: &mut ChaCha8Rng) {
        self.phase = RequestPhase::Busy;
        let spread = 1.0 + PRESENT_SPREAD * (2.0 * random.random::<f64>() - 1.0);
        let seconds = match self.request.kind.get() {
            Some(RequestKind::NewBox) => self.model.new_box,
            Some(RequestKind::Present) => self.model.present * spread,
            Some(RequestKind::Rescan | RequestKind::None) | None => 0.0,
        };
        self.ready_at = now.after(Duration::from_secs_f64(seconds));
    }

    fn serve(&mut self, parts: &mut Parts, world: &mut PhysicsWorld, random: &mut ChaCha8Rng) -> bool {
        match self.request.kind.get() {
            Some(RequestKind::NewBox) => {
                parts.clear(world);
                self.presented = None;
                true
            }
            Some(RequestKind::Present) => self.present(parts, world, random),
            Some(RequestKind::Rescan) => {
                let there = self.presented.is_some();
                if there {
                    self.presented_by = self.request.id;
                    self.scans_left = SCANS;
                }
                there
            }
            Some(RequestKind::None) => true,
            None => false,
        }
    }

    fn present(&mut self, parts: &mut Parts, world: &mut PhysicsWorld, random: &mut ChaCha8Rng) -> bool {
        let part = self.request.part_index as usize;
        // A part that fell is replaced by a spare; one in use cannot be in two places.
        let Some(model) =
            parts.model(part).filter(|_| matches!(parts.place(part), Place::Store | Place::Station | Place::Lost))
        else {
            return false;
        };
        let Some(base_from_station) = self.model.base_from_station.get(model.station).copied() else { return false };
        let (metres, radians) = self.model.jitter;
        let mut drawn = || -> f64 { Normal::new(0.0, 1.0).map_or(0.0, |normal| normal.sample(random)) };
        let mut spread = |sigma: f64| drawn().clamp(-2.0, 2.0) * sigma;
        let lies = Isometry3::from_parts(
            Translation3::new(spread(metres), spread(metres), 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), spread(radians)),
        );
        // The part turns about its own upright, wherever on the carrier it lies.
        let station_from_part = model.station_from_part;
        let upright = Isometry3::from_parts(station_from_part.translation, UnitQuaternion::identity());
        let jittered = upright * lies * upright.inverse() * station_from_part;
        parts.present(world, part, base_from_station * jittered);
        self.base_from_station = pose_of(&base_from_station);
        self.presented = Some(part);
        self.presentations += 1;
        self.presented_by = self.request.id;
        self.scans_left = SCANS;
        true
    }

    /// The part that stands at its station, if any.
    pub(super) fn presented(&self) -> Option<usize> {
        self.presented
    }

    /// The request whose scans are being taken; 0 when there is nothing to look at.
    pub(super) fn scan_request(&self) -> u32 {
        if self.presented.is_some() { self.presented_by } else { 0 }
    }

    /// Whether the camera is to look now; counts the look.
    pub(super) fn scan_due(&mut self, now: Stamp, period: Duration) -> bool {
        let spacing = u64::try_from(self.model.scan_period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let on_grid = u128::from(now.0 % spacing) < period.as_nanos();
        let due = on_grid && now >= self.scan_from && self.scans_left > 0 && self.presented.is_some();
        if due {
            self.scans_left -= 1;
        }
        due
    }

    /// The request spoken of, how far it has come, and the carrier in use.
    pub(super) fn answer(&self) -> (u32, RequestPhase, Pose) {
        (self.request.id, self.phase, self.base_from_station)
    }

    /// Parts presented so far.
    pub(super) fn presentations(&self) -> u32 {
        self.presentations
    }
}
