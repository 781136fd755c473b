fn main() {
    let lib = std::env::var("DUCKDB_LIB_DIR").unwrap_or_default();
    println!("cargo:rustc-link-arg=-Wl,-rpath,$ORIGIN");
    println!("cargo:rustc-link-arg=-Wl,-rpath,{lib}");
    println!("cargo:rerun-if-env-changed=DUCKDB_LIB_DIR");
}
