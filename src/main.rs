//! Thin binary: arguments to `cli`, error to exit code.

fn main() {}
