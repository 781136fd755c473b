//! The database into a new file, as it is at one instant, while others go on writing it.

use std::{
    path::Path,
    sync::atomic::{AtomicU32, Ordering},
};

use duckdb::AccessMode;

use super::{
    archive::quoted,
    files,
    open::connect,
    store::{Store, engine},
};
use crate::history::HistoryError;

/// Copies that were begun: each new file has a name of its own in SQL, as one may still hang in its disk.
static COPIES: AtomicU32 = AtomicU32::new(0);
/// The tables that are copied.
const TABLES: &str =
    "SELECT table_name FROM duckdb_tables() WHERE database_name = current_database() AND NOT temporary";

impl Store {
    /// Copies all tables into a new file and compares them, in one transaction. The copy has no free blocks.
    pub(super) fn copy_database(&self, to: &Path) -> Result<(), HistoryError> {
        files::remove(to);
        let copy = format!("copy_of_history_{}", COPIES.fetch_add(1, Ordering::Relaxed));
        self.db.execute_batch(&format!("ATTACH {} AS {copy} (READ_WRITE)", quoted(to))).map_err(engine)?;
        let compared = self.transaction(|| {
            let own: String = self.db.query_row("SELECT current_database()", [], |row| row.get(0))?;
            self.db.execute_batch(&format!("COPY FROM DATABASE \"{own}\" TO {copy}"))?;
            let mut tables = self.db.prepare(TABLES)?;
            let tables = tables.query_map([], |row| row.get::<_, String>(0))?.collect::<duckdb::Result<Vec<_>>>()?;
            let sum = |table: &str| {
                let sql = format!("SELECT count(*), sum(hash(row_of))::VARCHAR FROM {table} row_of");
                self.db.query_row(&sql, [], |row| Ok((row.get::<_, u64>(0)?, row.get::<_, Option<String>>(1)?)))
            };
            let mut differing = Vec::new();
            for table in tables {
                if sum(&format!("\"{own}\".{table}"))? != sum(&format!("{copy}.{table}"))? {
                    differing.push(table);
                }
            }
            Ok(differing)
        });
        let detached = self.db.execute_batch(&format!("DETACH {copy}")).map_err(engine);
        match compared.and_then(|differing| detached.map(|()| differing))?.as_slice() {
            [] => finish_log(to),
            tables => Err(HistoryError::Engine(format!("the copy of the database differs: {}", tables.join(", ")))),
        }
    }
}

/// Writes the log of a copy into its file: it stays behind where queries had all the memory when the copy was closed.
fn finish_log(copy: &Path) -> Result<(), HistoryError> {
    if files::has_log(copy) {
        connect(copy, AccessMode::ReadWrite).and_then(|db| db.execute_batch("CHECKPOINT")).map_err(engine)?;
    }
    match files::has_log(copy) {
        false => Ok(()),
        true => Err(HistoryError::Engine("the copy of the database was not completed".into())),
    }
}
