//! `tandem eval`: measures what is built against what is demanded of it.

use clap::{Args, Subcommand};

use super::features;

#[derive(Args)]
pub(super) struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// How well features are recognised and measured, on generated parts nothing was fitted on
    Features(features::FeaturesArgs),
}

pub(super) fn eval(args: &EvalArgs) -> u8 {
    let What::Features(args) = &args.what;
    features::features(args)
}
