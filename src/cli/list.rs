//! What a command does that lists what happened in a period: one query, its rows as lines, JSON or CSV.

use std::{path::PathBuf, sync::Arc};

use jiff::SignedDuration;
use serde::Serialize;

use crate::{
    history::{Answer, Query},
    plant::{PlantDef, def::CsvDialect},
    report::Period,
};

use super::{
    CliError, in_runtime, say,
    source::{CsvArgs, HistoryArgs, unexpected},
};

/// What is listed where no period is asked for.
const SPAN: SignedDuration = SignedDuration::from_hours(7 * 24);

/// Which period, and where its rows go.
#[derive(Debug, clap::Args)]
pub struct ListArgs {
    #[command(flatten)]
    history: HistoryArgs,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    /// Write CSV to this file instead, `-` for standard output: a row for each
    #[arg(long, short, value_name = "FILE", conflicts_with = "json")]
    out: Option<PathBuf>,
    #[command(flatten)]
    csv: CsvArgs,
}

/// The rows of an answer, and how they are written.
pub struct Rows<T> {
    /// Nothing where the answer is to another query.
    pub of: fn(Answer) -> Option<Vec<T>>,
    /// As CSV.
    pub csv: fn(&[T], &PlantDef, CsvDialect) -> Vec<u8>,
    /// As lines for a person.
    pub text: fn(&[T], &PlantDef) -> String,
}

impl ListArgs {
    /// The plant.
    pub fn load(&self) -> Result<Arc<PlantDef>, CliError> {
        self.history.load()
    }

    /// Asks the history and writes the rows.
    pub fn write<T: Serialize>(
        &self,
        def: &Arc<PlantDef>,
        query: impl FnOnce(Period) -> Query,
        rows: &Rows<T>,
    ) -> Result<(), CliError> {
        self.csv.refuse_unless(self.out.is_some())?;
        if let Some(out) = &self.out {
            self.history.refuse_own_file(def, out)?;
        }
        in_runtime(async {
            let (source, period) = self.history.open_latest(def, SPAN).await?;
            let list = (rows.of)(source.query(query(period)).await?).ok_or_else(unexpected)?;
            match &self.out {
                Some(out) => source.export(out, &(rows.csv)(&list, def, self.csv.dialect(def))).await?,
                None if self.json => {
                    say(&serde_json::to_string_pretty(&list).expect("its keys are words and its numbers are finite"));
                }
                None => say(&(rows.text)(&list, def)),
            }
            Ok(())
        })
    }
}
