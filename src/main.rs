//! Thin binary: arguments to `cli`, error to exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    sightglass::main()
}
