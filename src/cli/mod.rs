//! The command line: what a person types, and what comes back.
//!
//! Data goes to standard output, messages and progress to standard error. Every
//! verb that reports takes `--json` and then prints one object a line. Exit codes
//! are in [`exit`].

mod bench;
mod check;
mod doctor;
mod eval;
pub mod exit;
mod features;
mod journal;
mod policies;
mod progress;
mod recognise;
mod role;
mod run;
mod safety;
mod status;
mod table;
mod top;
mod train;
mod transfer;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// A zero-copy realtime controller for human-robot assembly workcells.
#[derive(Parser)]
#[command(name = "tandem", version, about, max_term_width = 110, after_help = exit::HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Start a cell and assemble boxes
    Run(run::RunArgs),
    /// Read and check every file, model and database of a cell; nothing starts
    Check(check::CheckArgs),
    /// What this host offers a realtime loop, and how to mend what it lacks
    Doctor(doctor::DoctorArgs),
    /// A running cell at one instant: what is done, how its loops keep their time
    Status(status::StatusArgs),
    /// The same on the screen, several times a second
    Top(top::TopArgs),
    /// How late loops wake, what messages and cycles cost, beside what others pay, in one run
    Bench(bench::BenchArgs),
    /// What was done to each box, by whom, when
    Journal(journal::JournalArgs),
    /// What perception makes of clouds and meshes in files
    Recognise(recognise::RecogniseArgs),
    /// Measure what is built against what is demanded of it
    Eval(eval::EvalArgs),
    /// Make the trained models that ship in config/models
    Train(train::TrainArgs),
    /// One role of a running cell (started by `tandem run`)
    #[command(hide = true)]
    Role(role::RoleArgs),
    /// The other process of a bench (started by `tandem bench`)
    #[command(hide = true)]
    BenchPeer(bench::PeerArgs),
}

/// Reads the command line, does what it says and answers with the exit code.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let asked = !error.use_stderr();
            // Nothing can be done about a closed terminal here.
            let _ = error.print();
            return if asked { exit::OK.into() } else { exit::USAGE.into() };
        }
    };
    let code = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Status(args) => status::status(&args),
        Command::Top(args) => top::top(&args),
        Command::Bench(args) => bench::bench(&args),
        Command::Journal(args) => journal::journal(&args),
        Command::Recognise(args) => recognise::recognise(&args),
        Command::Eval(args) => eval::eval(&args),
        Command::Train(args) => train::train(&args),
        Command::Role(args) => role::role(&args),
        Command::BenchPeer(args) => bench::peer(&args),
    };
    code.into()
}
