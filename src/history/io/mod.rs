//! The edge of the history: DuckDB, its files and its thread.

pub mod sql;
pub mod files;
pub mod store;
pub mod read;
pub mod writer;
pub mod thread;
#[cfg(test)]
mod tests;
