//! Records healthy runs of the simulated rover, every channel in them: what `vigil learn --more`
//! takes. `healthy FILE.csv.gz`

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use vigil_bench::field;
use vigil_bench::simulated::Rover;

fn main() -> ExitCode {
    vigil_bench::ended("healthy", run())
}

fn run() -> Result<(), Box<dyn Error>> {
    let options: Vec<String> = std::env::args().skip(1).collect();
    let [path] = options.as_slice() else {
        return Err("the one argument is the file to write, .csv.gz".into());
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    field::record(&Rover::read(&root)?, Path::new(path))
}
