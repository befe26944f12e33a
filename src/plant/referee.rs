//! The referee: counts what the arm touched and should not have.
//!
//! Looks every [`LOOK_EVERY`] at true poses, so it sees what really happened and
//! not what was planned. One contact is one meeting of the arm, its tool or the
//! part it carries with one object; it is counted when it begins. Surfaces must
//! overlap by more than [`DEPTH`].
//!
//! Not counted, because the work is just that:
//! - the tool at the rack and at a carrier with the part on it;
//! - the carried part at the carrier it is taken from;
//! - tool and carried part at the product, the fixture and the bench while the
//!   part is near its place, and shortly after it was let go;
//! - a person at the part they have hold of, and a person who touches an arm that stands.

use core::time::Duration;

use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::math::Pose as BodyPose;
use rapier3d_f64::parry::query::intersection_test;
use rapier3d_f64::parry::shape::{Capsule, Cuboid, Shape, SharedShape};
use tandem_clearance::LinkCapsule;
use tandem_msg::Stamp;

use super::frames::{apart, body_pose, vector};
use super::human::{CAPSULES, Limb};
use super::parts::{Block, Parts, Place};

/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Overlap that makes a contact, metres.
const DEPTH: f64 = 0.002;
/// Near its place, or its carrier, a part is within this distance, metres.
const NEAR: f64 = 0.15;
/// Time for the tool to leave the place where it let go of a part.
const LEAVING: Duration = Duration::from_secs(2);
/// An arm whose joints are slower than this stands, rad/s.
const STANDING: f64 = 0.01;

/// What the referee calls a thing that never moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Bench or fixture: touched while a part is seated.
    Table,
    /// A station's carrier.
    Carrier,
    /// The tool rack.
    Rack,
    /// Anything else.
    Other,
}

/// A box that never moves.
#[derive(Clone, Debug)]
pub(super) struct Obstacle {
    pub(super) kind: Kind,
    pub(super) half_extents: [f64; 3],
    pub(super) base_from_object: Isometry3<f64>,
}

/// What is looked at.
pub(super) struct Look<'a> {
    pub(super) base_from_link: &'a [Isometry3<f64>],
    pub(super) base_from_tcp: &'a Isometry3<f64>,
    /// Fastest joint, rad/s.
    pub(super) joint_speed: f64,
    pub(super) person: &'a [Limb; CAPSULES],
    pub(super) hand_on: Option<usize>,
}

/// What a piece is.
#[derive(Clone)]
enum Form {
    Capsule(Capsule),
    Cuboid(Cuboid),
    Hull(SharedShape),
}

impl Form {
    fn capsule(ends: &[Vector3<f64>; 2], radius: f64) -> Self {
        Self::Capsule(Capsule::new(vector(&ends[0]), vector(&ends[1]), radius))
    }

    /// The hull of some points, each moved inwards by [`DEPTH`]; `None` when that is no solid.
    fn hull(points: &[[f64; 3]]) -> Option<Self> {
        let sum: Vector3<f64> = points.iter().map(|point| Vector3::from(*point)).sum();
        let centre = sum / points.len().max(1) as f64;
        let inwards = |x: f64| x.signum() * (x.abs() - DEPTH).max(0.0);
        let moved = points.iter().map(|point| vector(&(centre + (Vector3::from(*point) - centre).map(inwards))));
        SharedShape::convex_hull(&moved.collect::<Vec<_>>()).map(Self::Hull)
    }

    fn shape(&self) -> &dyn Shape {
        match self {
            Self::Capsule(capsule) => capsule,
            Self::Cuboid(cuboid) => cuboid,
            Self::Hull(hull) => &**hull,
        }
    }
}

/// A convex piece of arm, part or person with a sphere around it.
struct Piece {
    form: Form,
    pose: BodyPose,
    centre: Vector3<f64>,
    reach: f64,
}

/// A capsule of the arm, or the hull in it, with the middle of the capsule's segment and the radius of the
/// sphere around it, in the frame of its link.
struct Link {
    link: usize,
    tool: bool,
    form: Form,
    centre: Vector3<f64>,
    reach: f64,
}

struct Solid {
    kind: Kind,
    piece: Piece,
}

/// The referee and the count.
pub(super) struct Referee {
    links: Vec<Link>,
    fixed: Vec<Solid>,
    touching: Vec<bool>,
    contacts: u32,
    next_look: Stamp,
    held: Option<usize>,
    taken_at: Vector3<f64>,
    let_go: Option<Stamp>,
}

/// Which of the moving things a piece belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mover {
    Link,
    Tool,
    Part,
}

impl Referee {
    /// A referee who has seen nothing yet. The base link stands on the bench and is not looked at.
    pub(super) fn new(arm: &[(LinkCapsule, Vec<[f64; 3]>)], fixed: &[Obstacle], parts: usize) -> Self {
        let links = arm
            .iter()
            .filter(|(capsule, _)| capsule.link > 0)
            .map(|(capsule, hull)| {
                let [a, b] = capsule.ends.map(Vector3::from);
                Link {
                    link: capsule.link,
                    tool: capsule.tool,
                    form: Form::hull(hull)
                        .unwrap_or_else(|| Form::capsule(&[a, b], (capsule.radius - DEPTH).max(1e-4))),
                    centre: (a + b) / 2.0,
                    reach: (a - b).norm() / 2.0 + capsule.radius,
                }
            })
            .collect();
        let fixed: Vec<Solid> = fixed
            .iter()
            .map(|object| Solid { kind: object.kind, piece: cuboid(&object.base_from_object, object.half_extents) })
            .collect();
        Self {
            links,
            touching: vec![false; fixed.len() + parts + 1],
            fixed,
            contacts: 0,
            next_look: Stamp(0),
            held: None,
            taken_at: Vector3::zeros(),
            let_go: None,
        }
    }

    /// Contacts since the start.
    pub(super) fn contacts(&self) -> u32 {
        self.contacts
    }

    /// Looks, if it is time to.
    pub(super) fn cycle(&mut self, now: Stamp, look: &Look<'_>, parts: &Parts) {
        if parts.held() != self.held {
            self.let_go = self.held.map(|_| now);
            self.held = parts.held();
            self.taken_at = look.base_from_tcp.translation.vector;
        }
        if now < self.next_look {
            return;
        }
        self.next_look = now.after(LOOK_EVERY);
        let seen = self.see(now, look, parts);
        for (before, now) in self.touching.iter_mut().zip(seen) {
            self.contacts += u32::from(now && !*before);
            *before = now;
        }
    }

    /// What is being touched: fixed objects, then parts, then the person.
    fn see(&self, now: Stamp, look: &Look<'_>, parts: &Parts) -> Vec<bool> {
        let mut seen = vec![false; self.touching.len()];
        let leaving = self.let_go.is_some_and(|at| at.age_at(now) < LEAVING);
        let seating = leaving || self.held.is_some_and(|part| near_home(parts, part));
        let taking = (look.base_from_tcp.translation.vector - self.taken_at).norm() < NEAR;

        let allowed = |mover: Mover, kind: Kind| match (mover, kind) {
            (Mover::Link, _) | (_, Kind::Other) => false,
            (Mover::Tool, Kind::Rack | Kind::Carrier) => true,
            (Mover::Part, Kind::Carrier) => taking,
            (Mover::Part, Kind::Rack) => false,
            (_, Kind::Table) => seating,
        };
        for link in &self.links {
            let Some(frame) = look.base_from_link.get(link.link) else { continue };
            let piece = Piece {
                form: link.form.clone(),
                pose: body_pose(frame),
                centre: frame.transform_point(&link.centre.into()).coords,
                reach: link.reach,
            };
            let mover = if link.tool { Mover::Tool } else { Mover::Link };
            self.meet(&piece, mover, &allowed, look, parts, seating, &mut seen);
        }
        if let Some(part) = self.held {
            for piece in blocks(parts, part) {
                self.meet(&piece, Mover::Part, &allowed, look, parts, seating, &mut seen);
            }
        }
        seen
    }

    #[allow(clippy::too_many_arguments)]
    fn meet(
        &self,
        piece: &Piece,
        mover: Mover,
        allowed: &dyn Fn(Mover, Kind) -> bool,
        look: &Look<'_>,
        parts: &Parts,
        seating: bool,
        seen: &mut [bool],
    ) {
        for (solid, seen) in self.fixed.iter().zip(seen.iter_mut()) {
            *seen |= !allowed(mover, solid.kind) && overlap(piece, &solid.piece);
        }
        let first_part = self.fixed.len();
        for part in 0..parts.count() {
            let counts = match parts.place(part) {
                Place::Product => mover == Mover::Link || !seating,
                Place::Station => mover == Mover::Link,
                _ => false,
            };
            seen[first_part + part] |= counts && blocks(parts, part).any(|block| overlap(piece, &block));
        }
        let standing = look.joint_speed < STANDING;
        let handed = mover == Mover::Part && look.hand_on.is_some() && look.hand_on == self.held;
        if !standing && !handed {
            let person = &mut seen[first_part + parts.count()];
            *person |= look.person.iter().any(|limb| overlap(piece, &limb_piece(limb)));
        }
    }
}

fn near_home(parts: &Parts, part: usize) -> bool {
    parts.model(part).is_some_and(|model| apart(&parts.base_from_part(part), &model.base_from_place).0 < NEAR)
}

fn cuboid(pose: &Isometry3<f64>, half: [f64; 3]) -> Piece {
    let half = Vector3::from(half);
    Piece {
        form: Form::Cuboid(Cuboid::new(vector(&half))),
        pose: body_pose(pose),
        centre: pose.translation.vector,
        reach: half.norm(),
    }
}

fn blocks(parts: &Parts, part: usize) -> impl Iterator<Item = Piece> {
    let pose = parts.base_from_part(part);
    let blocks: &[Block] = parts.model(part).map_or(&[], |model| &model.blocks);
    blocks.iter().map(move |block| {
        let half = block.half_extents.map(|h| (h - DEPTH).max(h * 0.25));
        cuboid(&(pose * nalgebra::Translation3::from(Vector3::from(block.centre))), half)
    })
}

fn limb_piece(limb: &Limb) -> Piece {
    let [a, b] = limb.ends;
    Piece {
        form: Form::capsule(&limb.ends, limb.radius - DEPTH),
        pose: BodyPose::IDENTITY,
        centre: (a + b) / 2.0,
        reach: (a - b).norm() / 2.0 + limb.radius,
    }
}

fn overlap(a: &Piece, b: &Piece) -> bool {
    let together = a.reach + b.reach;
    (a.centre - b.centre).norm_squared() <= together * together
        && intersection_test(&a.pose, a.form.shape(), &b.pose, b.form.shape()).is_ok_and(|met| met.intersecting)
}
