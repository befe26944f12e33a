//! Learning to move (Section 2.3, Fig. 7, Eq. (10)–(17)): where policies come from and what they are worth.
//!
//! ```text
//! World ── scenes ──▶ Environment ── steps ──▶ Replay ──▶ Agent (actor, two critics, columns)
//!            │            ▲                      ▲              │
//!            └─ planner ──┼── demonstrations ────┘              ▼
//!                         └──────────────────────────── actor's actions ──▶ precomputed policy
//! ```
//!
//! - [`World`] is a cell as its files say, [`scenes`] draws tasks in it that need a way around and have one.
//! - [`Environment`] steps one scene on the real kinematics and clearance, by the code that previews policies in a
//!   cell (`tandem_policy::Rollout`).
//! - [`Agent`] learns by twin delayed deterministic policy gradient, its networks are progressive ([`Network`]).
//! - [`train()`] is one training, [`run`] a course of them, with files; [`evaluate()`] measures policies beside a
//!   hand-made path and the sampling planner's.
//!
//! **Invariant:** product, subtask, method and seed decide a training to the bit, whatever the number of threads.
//! **Invariant:** training, validation and test scenes are drawn apart; nothing is chosen by test scenes.

mod adam;
mod agent;
mod bank;
mod baselines;
mod course;
mod environment;
mod evaluate;
mod expert;
mod matrix;
mod network;
mod replay;
mod rollouts;
mod timing;
mod train;
mod world;

pub use adam::Adam;
pub use agent::{Agent, Losses, Tuning};
pub use bank::{Split, demonstrations, scenes};
pub use baselines::{follow, manual, planned, shortened};
pub use course::{CURVE, Course, Progress, folder, run};
pub use environment::{Environment, INPUTS, STEP_TIME, Shield, Stepped};
pub use evaluate::{Candidate, Extent, Rate, Row, evaluate, median, move_by};
pub use network::{ALPHA, Network, Pass};
pub use replay::{Replay, Transition};
pub use rollouts::{Act, Outcome, rollouts};
pub use timing::duration;
pub use train::{Lessons, Method, Point, TrainOptions, Trained, train};
pub use world::{Joints, MARGIN, Scene, Subtask, World};
