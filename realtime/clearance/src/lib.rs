//! Distances between the arm and everything it must not touch, and the separation a person is owed.
//!
//! The arm is a set of capsules or of hulls in them ([`ArmBody`]), the part it carries a box or a hull, the
//! scene boxes, cylinders, capsules, spheres, hulls and meshes, a person a set of capsules. Hulls and meshes
//! are registered at start ([`Shapes`]) and then go by their number.
//! [`Monitor`] holds one of each and answers, for one position of the arm:
//!
//! - [`Monitor::clearance`]: the smallest signed distance to the scene and to the
//!   arm itself, with the link, the object and the points;
//! - [`Monitor::separation`]: the same towards people, with their velocity; [`Monitor::links_to_people`]: for each
//!   link and body part; [`Monitor::measure`]: clearance and separation at once;
//! - [`Monitor::track`]: the clearance again, quicker where the arm has moved little;
//! - [`Monitor::is_clear`], [`Monitor::path_is_clear`]: whether a position, or a whole
//!   straight motion of the joints, keeps a margin. The motion is swept, not sampled; [`MotionSweep`]
//!   is the same a look at a time.
//!
//! [`Monitor::link_pairs`] works out, while starting, which links of the arm can meet, and
//! [`Monitor::hidden_contacts`] what a matrix of allowed collisions hides.
//!
//! [`ssm`] holds the arithmetic of speed and separation monitoring: how far the arm must
//! stay from a person who moves, and how fast it may go at the distance there is; [`pfl`] that of contacts.
//!
//! **Invariant:** no answer is larger than the truth, but for rounding (below 1e-9 m). Capsules and boxes
//! are exact; all else, and capsules at the rim of a cylinder, is answered with a proven bound. Depths between convex bodies are at
//! least the true ones; a core that crosses a mesh is as deep as the box around that, one outside it as at the nearest triangle.
//! **Invariant:** what is not finite, or absurdly far off, is a contact: the answer is −∞.
//! **Invariant:** no query allocates, blocks or panics; every loop has a constant bound.

mod answer;
mod body;
mod contacts;
mod hull;
mod kernel;
mod lanes;
mod mesh;
mod monitor;
mod nearest;
mod obstacle;
mod people;
pub mod pfl;
mod placed;
mod shapes;
pub mod ssm;
mod sweep;
mod targets;
mod track;

pub use answer::{Clearance, Separation};
pub use body::{ArmBody, BodyError, LINK_CAPSULES_MAX, LinkCapsule, SELF_PAIRS_MAX};
pub use contacts::{LinkPair, Meeting};
pub use monitor::Monitor;
pub use obstacle::SceneFault;
pub use people::{LinksToPeople, Nearness};
pub use shapes::{HULL_POINTS_MAX, MESH_TRIANGLES_MAX, ShapeError, Shapes};
pub use sweep::{MotionSweep, Swept};
