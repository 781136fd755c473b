//! The store beside the audit log: which entries it holds, and each of them once.

use std::collections::HashSet;

use duckdb::params;

use super::{
    sql,
    store::{Store, engine, utc},
    stored::Stored,
};
use crate::{
    history::HistoryError,
    plant::record::{ActionRecord, ChainHash},
};

/// Entries that are compared with the audit log at a start: the latest.
pub const CHAIN_HASHES_MAX: usize = 5_000;

/// The chain hashes of the latest entries, newest first.
const CHAIN_HASHES: &str = "SELECT number, any_value(hash) FROM operator_action WHERE number IS NOT NULL
    GROUP BY number ORDER BY number DESC LIMIT ?";
/// What a store holds of the audit log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StoredEntries {
    /// The chain hashes of the latest entries.
    pub chain_hashes: Vec<ChainHash>,
    /// Actions that the log had not when they were stored, oldest first: it could not be written.
    pub unchained: Vec<ActionRecord>,
}

/// Is an action stored without its chain hash, because the audit log could not be written?
const UNCHAINED: &str = "SELECT count(*) FROM (SELECT 1 FROM operator_action WHERE number IS NULL LIMIT 1)";
/// The action that is about to be stored with its chain hash.
const REMOVE_UNSEALED: &str = "DELETE FROM operator_action WHERE number IS NULL AND utc = ? AND by_whom = ?
    AND action = ? AND target = ? AND outcome = ? AND coalesce(new_value, '') = ?";

/// What distinguishes an action from others, as [`REMOVE_UNSEALED`] has it.
fn key(action: &ActionRecord) -> (i64, &str, &str, &str, &str, &str) {
    let ActionRecord { at, by, action, target, outcome, new, .. } = action;
    (at.as_microsecond(), by, action, target, outcome, new.as_deref().unwrap_or_default())
}

impl Store {
    /// The chain hashes of the latest entries, at most [`CHAIN_HASHES_MAX`].
    pub fn chain_hashes(&self) -> Result<Vec<ChainHash>, HistoryError> {
        let mut statement = self.db.prepare(CHAIN_HASHES).map_err(engine)?;
        let row = |row: &duckdb::Row| Ok((row.get::<_, u64>(0)?, row.get::<_, Vec<u8>>(1)?));
        let rows = statement.query_map(params![CHAIN_HASHES_MAX as u64], row).map_err(engine)?;
        let chain_hash = |row: duckdb::Result<(u64, Vec<u8>)>| {
            let (number, hash) = row.map_err(engine)?;
            // A hash of another length is none that the audit log has.
            Ok(ChainHash { number, hash: hash.try_into().unwrap_or_default() })
        };
        rows.map(chain_hash).collect()
    }

    /// What is compared with the audit log at a start.
    pub(super) fn stored_entries(&self) -> Result<StoredEntries, HistoryError> {
        let mut unchained = self.list(&sql::unchained(CHAIN_HASHES_MAX), &[], ActionRecord::read)?;
        unchained.reverse();
        Ok(StoredEntries { chain_hashes: self.chain_hashes()?, unchained })
    }

    /// Makes room for actions that come with their chain hashes and were stored without before, or come without among these:
    /// the disk took neither for a while. Part of a transaction.
    pub(super) fn remove_unsealed(&self, actions: &mut Vec<&ActionRecord>) -> duckdb::Result<()> {
        let chained = actions.iter().filter(|action| action.chain_hash.is_some()).map(|action| key(action));
        let chained: HashSet<_> = chained.collect();
        actions.retain(|action| action.chain_hash.is_some() || !chained.contains(&key(action)));
        let mut chained = actions.iter().filter(|action| action.chain_hash.is_some()).peekable();
        if chained.peek().is_none() || self.db.query_row(UNCHAINED, [], |row| row.get::<_, u64>(0))? == 0 {
            return Ok(());
        }
        let mut remove = self.db.prepare(REMOVE_UNSEALED)?;
        for action in chained {
            let new = action.new.as_deref().unwrap_or_default();
            remove.execute(params![utc(action.at), action.by, action.action, action.target, action.outcome, new])?;
        }
        Ok(())
    }
}
