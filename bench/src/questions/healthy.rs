//! Records healthy runs of the simulated rover, every channel in them, for `vigil learn --more`.

use std::error::Error;
use std::path::PathBuf;

use vigil_bench::field;
use vigil_bench::simulated::Rover;

/// Where the runs go.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file to write, .csv.gz.
    file: PathBuf,
}

/// Records.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    field::record(&Rover::read()?, &args.file)
}
