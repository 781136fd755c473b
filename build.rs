//! Packs the profiles into one archive, which the program unpacks from; makes the prebuilt DuckDB library present before the
//! link, checks it, and lets the binary find it when it starts.
//!
//! The library is what `DUCKDB_LIB_DIR` already holds, or comes from the npm package that ships it. Either way its SHA-256 must be the
//! one that is known here, or the one that `DUCKDB_LIB_SHA256` states.
//! With the feature `bundled` DuckDB is compiled from source and nothing of this happens to a library.

use std::{
    env, fs,
    io::Write,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::Command,
};

use sha2::{Digest, Sha256};
use zip::{ZipWriter, result::ZipResult, write::SimpleFileOptions};

const VERSION: &str = "1.5.6";
const LIBRARY: &str = "libduckdb.so";

/// The npm package with the library for one processor, and the SHA-256 of the library in it.
const NPM_X64: (&str, &str) =
    ("@duckdb/node-bindings-linux-x64", "3f4962cdd266eab2b479a5b5a4a6d063d279b2954ae814ed00385d553b747633");

fn main() {
    println!("cargo:rerun-if-env-changed=DUCKDB_LIB_DIR");
    println!("cargo:rerun-if-env-changed=DUCKDB_LIB_SHA256");
    println!("cargo:rerun-if-changed=profiles");
    if let Err(why) = pack_profiles() {
        panic!("the profiles cannot be packed: {why}");
    }
    if env::var_os("CARGO_FEATURE_BUNDLED").is_some() {
        return;
    }
    let folder = lib_dir();
    let library = folder.join(LIBRARY);
    println!("cargo:rerun-if-changed={}", library.display());
    // Beside the binary or in the folder `lib` next to its own (an installed program); beside target/release/deps.
    // No path of this machine: whoever could write there would run code in an installed program.
    for path in ["$ORIGIN", "$ORIGIN/../lib", "$ORIGIN/.."] {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{path}");
    }
    let there = if library.exists() { check(&library) } else { fetch(&folder) };
    if let Err(why) = there.and_then(|()| link_beside_binary(&library)) {
        panic!(
            "\n\nDuckDB {VERSION} in {}:\n  {why}\n\n\
             Do one of these:\n\
             - on x86-64: remove what is there, install npm (Debian: apt-get install npm), with a network, and build again;\n\
             - put {LIBRARY} of DuckDB {VERSION} into that folder, or point DUCKDB_LIB_DIR at a folder that has it, and\n  \
               state its SHA-256, from a source that you trust, in DUCKDB_LIB_SHA256;\n\
             - build with `--features bundled`, which compiles DuckDB from source (an hour on two cores).\n",
            folder.display()
        );
    }
}

/// A profile is text that packs to a fifth; the same files always make the same archive.
fn pack_profiles() -> ZipResult<()> {
    let root = Path::new("profiles");
    let mut archive = ZipWriter::new(fs::File::create(out_dir().join("profiles.zip"))?);
    let mut files = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(ending) if ending == "toml" || ending == "txt" => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    for file in &files {
        let inside = file.strip_prefix(root).unwrap_or(file).to_string_lossy();
        archive.start_file(inside, SimpleFileOptions::default().last_modified_time(zip::DateTime::default()))?;
        archive.write_all(&fs::read(file)?)?;
    }
    archive.finish().map(drop)
}

fn lib_dir() -> PathBuf {
    match env::var_os("DUCKDB_LIB_DIR") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("vendor/duckdb"),
    }
}

/// The package of the processor that is built for, if its library is known.
fn package() -> Result<(&'static str, &'static str), String> {
    match (env::var("CARGO_CFG_TARGET_OS").as_deref(), env::var("CARGO_CFG_TARGET_ARCH").as_deref()) {
        (Ok("linux"), Ok("x86_64")) => Ok(NPM_X64),
        (os, arch) => Err(format!(
            "no checksum of the library is known for {} on {}",
            os.unwrap_or_default(),
            arch.unwrap_or_default()
        )),
    }
}

/// Nothing is linked that is not what was meant.
fn check(library: &Path) -> Result<(), String> {
    let expected = match env::var("DUCKDB_LIB_SHA256") {
        Ok(stated) => stated.to_ascii_lowercase(),
        Err(_) => package()?.1.to_owned(),
    };
    let bytes = fs::read(library).map_err(|error| error.to_string())?;
    let found = format!("{:x}", Sha256::digest(bytes));
    if found == expected { Ok(()) } else { Err(format!("{LIBRARY} has SHA-256 {found}, expected {expected}")) }
}

fn fetch(folder: &Path) -> Result<(), String> {
    let (npm, _) = package()?;
    let work = out_dir().join("duckdb-fetch");
    let _ = fs::remove_dir_all(&work);
    fs::create_dir_all(&work).and_then(|()| fs::create_dir_all(folder)).map_err(|error| error.to_string())?;
    run(Command::new("npm").args(["pack", "--silent", &format!("{npm}@{VERSION}-r.1")]).current_dir(&work))?;
    let archive = fs::read_dir(&work)
        .map_err(|error| error.to_string())?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .find(|path| path.extension().is_some_and(|ending| ending == "tgz"))
        .ok_or("npm left no archive")?;
    run(Command::new("tar")
        .arg("xzf")
        .arg(archive)
        .args(["--strip-components=1", &format!("package/{LIBRARY}")])
        .current_dir(&work))?;
    let fetched = work.join(LIBRARY);
    check(&fetched)?;
    // Rename within the folder, so that a build that is killed never leaves half a library behind.
    let part = folder.join(format!("{LIBRARY}.part"));
    fs::copy(&fetched, &part).and_then(|_| fs::rename(&part, folder.join(LIBRARY))).map_err(|error| error.to_string())
}

fn out_dir() -> PathBuf {
    PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"))
}

/// The binary finds the library beside itself, wherever the target folder is: `OUT_DIR` is target/release/build/NAME/out.
fn link_beside_binary(library: &Path) -> Result<(), String> {
    let out = out_dir();
    let beside = out.ancestors().nth(3).ok_or("OUT_DIR is no folder of cargo")?.join(LIBRARY);
    println!("cargo:rerun-if-changed={}", beside.display());
    let library = fs::canonicalize(library).map_err(|error| error.to_string())?;
    if fs::canonicalize(&beside).is_ok_and(|there| there == library) {
        return Ok(());
    }
    let new = out.join(LIBRARY);
    let _ = fs::remove_file(&new);
    symlink(&library, &new).and_then(|()| fs::rename(&new, &beside)).map_err(|error| error.to_string())
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
