//! `tandem eval`: measures what is built against what is demanded of it.

use clap::{Args, Subcommand};

use super::{features, policies, safety};

#[derive(Args)]
pub(super) struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// How well features are recognised and measured, on generated parts nothing was fitted on
    Features(features::FeaturesArgs),
    /// Random scenes, motions and people against the controller: is anybody touched, is anybody in the way for nothing
    Safety(safety::SafetyArgs),
    /// Collision rate and running time of learned, hand-made and planned motion, subtask by subtask
    Policies(policies::PoliciesArgs),
}

pub(super) fn eval(args: &EvalArgs) -> u8 {
    match &args.what {
        What::Features(args) => features::features(args),
        What::Safety(args) => safety::safety(args),
        What::Policies(args) => policies::policies(args),
    }
}
