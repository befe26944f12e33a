//! `tandem role`: one role of a live cell. Started by `tandem run`, not by people.

use std::path::PathBuf;

use clap::Args;
use tandem_msg::{Coded, Role};

use super::exit;
use crate::live;

#[derive(Args)]
pub(super) struct RoleArgs {
    /// plant, perception or controller
    #[arg(value_parser = |name: &str| Role::named(name).ok_or("no such role"))]
    role: Role,
    /// Cell file
    #[arg(long)]
    cell: PathBuf,
    /// Product instead of the one the cell file names
    #[arg(long)]
    product: Option<String>,
    /// Run directory of the cell
    #[arg(long)]
    instance: PathBuf,
    /// Incarnation
    #[arg(long)]
    epoch: u64,
    /// Seed of the run
    #[arg(long)]
    seed: u64,
    /// Folder for the records of stops
    #[arg(long)]
    stops: Option<PathBuf>,
}

pub(super) fn role(args: &RoleArgs) -> u8 {
    let args = live::RoleArgs {
        role: args.role,
        cell: args.cell.clone(),
        product: args.product.clone(),
        instance: args.instance.clone(),
        epoch: args.epoch,
        seed: args.seed,
        stops: args.stops.clone(),
    };
    match live::role(&args) {
        Ok(()) => exit::OK,
        Err(error) => {
            anstream::eprintln!("{error}");
            error.exit_code()
        }
    }
}
