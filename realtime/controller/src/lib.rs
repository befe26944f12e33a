//! The controller role: plans a motion, follows it at a fixed rate, owns the protective stop.
//!
//! [`Controller::cycle`] is a pure function of its state, the time and four
//! inputs. In each cycle it judges what it heard, decides by the stop monitor
//! whether the arm may move, goes on with the task (plan, follow, act,
//! withdraw), and checks the next set-point *before* it goes out: its clearance,
//! the stop that would follow it, and the separation owed to a person. A
//! set-point that fails is not sent; the stop that was checked with the one
//! before it is.
//!
//! | stage | module |
//! |---|---|
//! | judge inputs | `inputs` |
//! | stop, latch, reset | `stop` |
//! | task in hand | `job`, `effector` |
//! | search a path | `plan`, `line`, `reach`, `sweep` |
//! | follow it | `path`, `law`, `motion` |
//! | check the next command | `guard`, `people`, `governor`, `pace`, `workspace`, `envelope` |
//! | keep what led to a stop | `black_box` |
//!
//! **Invariant:** an arm that engages is met where it is: the first command
//! continues its measured position and velocity.
//! **Invariant:** a stop on a path stays on that path, and the path was swept.
//! **Invariant:** nothing here allocates once it is made (but the list of a refused
//! [`Params::check`]), blocks, reads a clock or panics; every loop is bounded.
//!
//! In simulation only: a software stop is no certified safety function.

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a >= b)` is meant: what is no number fails the check")]

mod black_box;
mod effector;
mod envelope;
mod governor;
mod guard;
mod inputs;
mod job;
mod law;
mod line;
mod motion;
mod pace;
mod params;
mod path;
mod people;
mod plan;
mod reach;
mod role;
mod stop;
mod sweep;
mod workspace;

pub use black_box::{Record, StopRecord};
pub use params::{OutOfRange, Params, ParamsError, SeparationParams};
pub use plan::policy_for;
pub use role::{Controller, ControllerInputs, ControllerOutputs};
pub use workspace::{WALLS_MAX, Wall, Workspace};

/// One number per joint, rad or m; entries past the joints in use are 0.
type Joints = [f64; tandem_msg::JOINTS_MAX];
