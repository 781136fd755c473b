//! Lets a target find the DuckDB library beside itself, where the build of the program has put it.
fn main() {
    println!("cargo:rustc-link-arg-bins=-Wl,-rpath,$ORIGIN");
}
