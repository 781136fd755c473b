//! Reads a Parquet file of samples as the rows of text that a CSV file has, through an engine that can open nothing else.

use std::{
    fs::File,
    io::{Read, Seek},
    os::fd::AsRawFd,
};

use duckdb::{
    Connection,
    arrow::array::{Array, AsArray},
    params,
};
use jiff::Timestamp;

use crate::{
    history::{
        HistoryError,
        import::{self, Header, Record, Rows},
    },
    plant::def::PlantDef,
};

/// Its first and its last bytes.
const MARK: &[u8] = b"PAR1";
/// Of the engine: of a row group only what is read of it is in memory.
const MEMORY: &str = "128MB";

/// Does it begin as such a file? It stands at its beginning then as before.
pub fn is_one(file: &mut File) -> std::io::Result<bool> {
    let mut first = Vec::new();
    file.take(MARK.len() as u64).read_to_end(&mut first)?;
    file.rewind()?;
    Ok(first == MARK)
}

/// Its rows, with times from the first of these up to the second.
pub fn read(file: &File, def: &PlantDef, times: [Timestamp; 2]) -> Result<Rows, Vec<String>> {
    // The file that was opened, whatever has its name by now.
    let path = format!("/dev/fd/{}", file.as_raw_fd());
    let plain = |error: &duckdb::Error| {
        let words = HistoryError::Engine(error.to_string()).words();
        words.replace(&format!("'{path}'"), "it").replace(&path, "it")
    };
    let wrong = |error: duckdb::Error| vec![format!("cannot be read as Parquet: {}", plain(&error))];
    let db = engine(&path).map_err(wrong)?;
    let columns = columns(&db, &path).map_err(wrong)?;
    let header =
        Header { columns: columns.iter().map(|(name, _)| name.as_str()).collect(), separator: b',', counted_in: "row" };
    let names: Vec<String> = (0..columns.len()).map(|place| format!("c{place}")).collect();
    let texts: Vec<String> = columns.iter().zip(&names).map(|((_, kind), name)| text_of(kind, name)).collect();
    let sql = format!("SELECT {} FROM read_parquet('{path}') AS t({})", texts.join(", "), names.join(", "));
    let mut statement = db.prepare(&sql).map_err(wrong)?;
    // By `step`: the stream itself panics where it meets an error.
    let _ = statement.stream_arrow(params![]).map_err(wrong)?;
    let (mut batch, mut number) = (Vec::new(), 0);
    let records = std::iter::from_fn(|| {
        while batch.is_empty() {
            let next = match statement.step() {
                Ok(next) => next?,
                Err(error) => return Some((number + 1, Err(plain(&error)))),
            };
            let cells: Vec<_> = next.columns().iter().map(|column| column.as_string::<i32>()).collect();
            let row = |row: usize| {
                cells.iter().map(|cells| if cells.is_valid(row) { cells.value(row) } else { "" }).collect()
            };
            batch = (0..next.len()).rev().map(row).collect();
        }
        number += 1;
        batch.pop().map(|row| -> Record { (number, Ok(row)) })
    });
    import::parse(def, &header, records, times)
}

/// An engine for one file.
fn engine(path: &str) -> duckdb::Result<Connection> {
    let db = Connection::open_in_memory()?;
    db.execute_batch(&format!(
        "SET memory_limit = '{MEMORY}'; SET threads = 1; SET temp_directory = ''; SET TimeZone = 'UTC';
         SET autoinstall_known_extensions = false; SET autoload_known_extensions = false;
         SET allowed_paths = ['{path}']; SET enable_external_access = false; SET lock_configuration = true;"
    ))?;
    Ok(db)
}

/// The names and types of its columns.
fn columns(db: &Connection, path: &str) -> duckdb::Result<Vec<(String, String)>> {
    let sql = format!("SELECT column_name, column_type FROM (DESCRIBE SELECT * FROM read_parquet('{path}'))");
    let mut statement = db.prepare(&sql)?;
    let columns = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    columns.collect()
}

/// A column as text: instants as they are written elsewhere, and what is certain to be UTC says so.
fn text_of(kind: &str, name: &str) -> String {
    match kind {
        "TIMESTAMP WITH TIME ZONE" => format!("replace(timezone('UTC', {name})::VARCHAR, ' ', 'T') || 'Z'"),
        kind if kind.starts_with("TIMESTAMP") => format!("replace({name}::VARCHAR, ' ', 'T')"),
        _ => format!("{name}::VARCHAR"),
    }
}
