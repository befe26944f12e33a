//! The `tandem` command.

use std::process::ExitCode;

use tandem_cycle::guard::CountingAllocator;

/// The system's allocator; counts what realtime loops ask of it.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    tandem::cli::main()
}
