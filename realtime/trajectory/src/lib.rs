//! Jerk-limited online trajectory generation, from any state to any target state.
//!
//! Given where each joint is (position, velocity, acceleration), where it shall go, and its limits,
//! [`Trajectory::calculate`] gives the fastest motion in which all joints arrive together, inside a
//! control cycle: no allocation, no lock, no unbounded loop, no randomness. It is calculated anew
//! whenever the target, the limits or the measured state change.
//!
//! ```
//! use tandem_trajectory::{Input, Limits, State, Trajectory};
//!
//! let mut input = Input::<2>::default();
//! input.start[0] = State { position: 0.0, velocity: 0.4, acceleration: 0.0 };
//! input.target = [State::at_rest(1.0), State::at_rest(-0.2)];
//! input.limits = [Limits::symmetric(1.0, 2.0, 10.0); 2];
//! let trajectory = Trajectory::calculate(&input)?;
//! assert_eq!(trajectory.at(trajectory.duration()), input.target);
//! # Ok::<(), tandem_trajectory::Error>(())
//! ```
//!
//! # How it works
//!
//! Everything rests on one observation. The motions of a joint that take a given time `T` between two
//! given states form a *convex* set: the dynamics are linear, and limits on velocity, acceleration and
//! jerk are intervals. Hence:
//!
//! 1. The distances covered in time `T` form an interval `[P_low(T), P_high(T)]`. Its ends belong to
//!    two *extremal motions*, which raise the velocity as early, and drop it as late, as the limits
//!    allow, or the other way round. For a given `T` they have closed forms with one square root (module
//!    `extremal`).
//! 2. A duration is *possible* if and only if the change of velocity can be made in it (module `swing`)
//!    and the distance lies in that interval (module `reach`). The first possible duration is the
//!    minimum; where the distance leaves the interval again lies a *blocked interval*.
//! 3. The curves `P_high` and `P_low` are cut into monotone pieces by the zeros of their slope, which are
//!    roots of quadratics. A crossing with the wanted distance is a root on one such piece, found by
//!    Halley's iteration in a bracket. There is no case distinction by profile type, no quartic, and
//!    no final test that a candidate could miss by a tolerance.
//! 4. Joints that arrive together take the first duration possible for all (module `trajectory`). Each is
//!    asked for its first one not below what those before have agreed on, so most only say whether they
//!    can take as long.
//! 5. A motion for *any* possible duration is a mixture of the two extremal ones, with weights such
//!    that the distance is right. It keeps every limit because both do. So synchronising needs no
//!    search, and cannot fail.
//!
//! Where only a velocity is wanted, one acceleration to wait at takes the place of the mixture (module
//! `swing`). A start outside the limits gets a prefix that brings it back, and a target outside them, if
//! allowed, a suffix ([`Input::target_outside`], module `brake`); a straight line
//! through joint space is the problem of one joint with the tightest limits (module `straight`).
//!
//! # What is built on it
//!
//! [`Trajectory::recalculate`] (in place), [`Trajectory::stop`] and [`Stopping`] (where a joint stands if it brakes now), [`Cursor`] (times that
//! only rise), [`Profile::extrema`] and [`Profile::first_time_at`], [`Input::minimum_durations`],
//! [`Generator`] (a loop that calculates only what has changed), [`Route`] (through waypoints, with a budget
//! of work), [`Tracker`] (a target that moves, one cycle behind).
//!
//! # Exactness
//!
//! Nothing is compared with an absolute tolerance: scaling lengths or times by powers of two scales
//! the answer to the bit, and mirroring changes nothing but signs. Ties are decided within a few
//! roundings of the inputs. A loop that calculates every cycle from its own output arrives when the first
//! trajectory said, within a microsecond: what its roundings can have collected, `2^-41` of the way on which a
//! joint brakes from its highest velocity, is no miss where correcting it would take out of proportion (module
//! `reach`; [`Input::tolerance`] asks for more). Switching times are
//! stored to more digits than a double has, so that integrating the [`Segment`]s gives the end state.
//! Only `+ - * /` and the square root are used, all of them correctly rounded, so every machine
//! calculates the same bits: `tests/builds` compares debug, release, one for the very processor and one without
//! `std`, each also after other calculations. It finds nothing that panics in the release object, either.
//!
//! # Bounds
//!
//! | loop | at most |
//! |---|---|
//! | passes over the joints until a shared duration is found | `2 + 3 N` |
//! | pieces of an extremal curve | 16 |
//! | steps of a root search | 2200, two to four as a rule |
//! | calculations of a [`Route`] | its budget and `2 (W + 1)` |
//! | calculations of a [`Tracker`] | 48 a joint, two or three as a rule |
//! | segments of a joint | 14, and the end state |
#![no_std]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod brake;
mod covering;
mod cursor;
mod error;
mod extrema;
mod extremal;
mod generator;
mod input;
mod instant;
mod motion;
mod profile;
mod reach;
mod root;
mod route;
mod sqrt;
mod state;
mod stopping;
mod straight;
mod swing;
mod task;
mod tracker;
mod trajectory;
mod writer;

pub use cursor::Cursor;
pub use error::Error;
pub use extrema::{Extrema, Reached};
pub use generator::{Generator, Step};
pub use input::{Input, Interface, Synchronization};
pub use profile::{Profile, Segment};
pub use route::{Route, Waypoints};
pub use state::{Limits, State};
pub use stopping::Stopping;
pub use tracker::Tracker;
pub use trajectory::Trajectory;
