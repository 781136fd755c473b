//! Makes the prebuilt DuckDB library present before the link, and lets the binary find it when it starts.
//!
//! Order of sources: what `DUCKDB_LIB_DIR` already holds; the npm package that ships the library; DuckDB's own release.
//! With the feature `bundled` DuckDB is compiled from source and nothing of this happens.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use sha2::{Digest, Sha256};

const VERSION: &str = "1.5.6";
const LIBRARY: &str = "libduckdb.so";

/// What is fetched for one processor.
struct Source {
    npm: &'static str,
    release: &'static str,
    /// SHA-256 of the library in the npm package, where it is known.
    sha256: Option<&'static str>,
}

fn main() {
    println!("cargo:rerun-if-env-changed=DUCKDB_LIB_DIR");
    if env::var_os("CARGO_FEATURE_BUNDLED").is_some() {
        return;
    }
    let folder = lib_dir();
    let library = folder.join(LIBRARY);
    println!("cargo:rerun-if-changed={}", library.display());
    // Beside the binary (an installed program), in the cache as seen from target/release and target/release/deps,
    // and where the library was at build time (a target folder elsewhere).
    for path in ["$ORIGIN", "$ORIGIN/../lib", "$ORIGIN/../../vendor/duckdb", "$ORIGIN/../../../vendor/duckdb"] {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{path}");
    }
    println!("cargo:rustc-link-arg=-Wl,-rpath,{}", folder.display());
    if !library.exists()
        && let Err(why) = fetch(&folder)
    {
        panic!(
            "\n\nDuckDB {VERSION} is not in {} and could not be fetched:\n{why}\n\n\
             Do one of these:\n\
             - install npm (Debian: apt-get install npm) or curl and unzip, with a network, and build again;\n\
             - put {LIBRARY} of DuckDB {VERSION} into that folder, or point DUCKDB_LIB_DIR at a folder that has it;\n\
             - build with `--features bundled`, which compiles DuckDB from source (an hour on two cores).\n",
            folder.display()
        );
    }
}

fn lib_dir() -> PathBuf {
    match env::var_os("DUCKDB_LIB_DIR") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("vendor/duckdb"),
    }
}

fn source() -> Result<Source, String> {
    match (env::var("CARGO_CFG_TARGET_OS").as_deref(), env::var("CARGO_CFG_TARGET_ARCH").as_deref()) {
        (Ok("linux"), Ok("x86_64")) => Ok(Source {
            npm: "@duckdb/node-bindings-linux-x64",
            release: "libduckdb-linux-amd64.zip",
            sha256: Some("3f4962cdd266eab2b479a5b5a4a6d063d279b2954ae814ed00385d553b747633"),
        }),
        (Ok("linux"), Ok("aarch64")) => {
            Ok(Source { npm: "@duckdb/node-bindings-linux-arm64", release: "libduckdb-linux-arm64.zip", sha256: None })
        }
        (os, arch) => Err(format!("no prebuilt library is known for {os:?} on {arch:?}")),
    }
}

fn fetch(folder: &Path) -> Result<(), String> {
    let source = source()?;
    let work = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("duckdb-fetch");
    let _ = fs::remove_dir_all(&work);
    fs::create_dir_all(&work).and_then(|()| fs::create_dir_all(folder)).map_err(|error| error.to_string())?;
    let fetched = from_npm(&source, &work).or_else(|npm| {
        from_release(&source, &work).map_err(|release| format!("  by npm: {npm}\n  by curl: {release}"))
    })?;
    // Rename within the folder, so that a build that is killed never leaves half a library behind.
    let part = folder.join(format!("{LIBRARY}.part"));
    fs::copy(&fetched, &part).and_then(|_| fs::rename(&part, folder.join(LIBRARY))).map_err(|error| error.to_string())
}

fn from_npm(source: &Source, work: &Path) -> Result<PathBuf, String> {
    let package = format!("{}@{VERSION}-r.1", source.npm);
    run(Command::new("npm").args(["pack", "--silent", &package]).current_dir(work))?;
    let archive = fs::read_dir(work)
        .map_err(|error| error.to_string())?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .find(|path| path.extension().is_some_and(|ending| ending == "tgz"))
        .ok_or("npm left no archive")?;
    run(Command::new("tar")
        .arg("xzf")
        .arg(archive)
        .args(["--strip-components=1", &format!("package/{LIBRARY}")])
        .current_dir(work))?;
    let library = work.join(LIBRARY);
    let found = format!("{:x}", Sha256::digest(fs::read(&library).map_err(|error| error.to_string())?));
    match source.sha256 {
        Some(expected) if expected != found => Err(format!("SHA-256 is {found}, expected {expected}")),
        Some(_) | None => Ok(library),
    }
}

fn from_release(source: &Source, work: &Path) -> Result<PathBuf, String> {
    let url = format!("https://github.com/duckdb/duckdb/releases/download/v{VERSION}/{}", source.release);
    run(Command::new("curl").args(["-fsSL", "--max-time", "600", "-o", "duckdb.zip", &url]).current_dir(work))?;
    run(Command::new("unzip").args(["-o", "-q", "duckdb.zip", LIBRARY]).current_dir(work))?;
    Ok(work.join(LIBRARY))
}

fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(format!("{name}: {}", said.lines().find(|line| line.contains("error")).unwrap_or("failed").trim()))
}
