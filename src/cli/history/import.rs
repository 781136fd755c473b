//! `sightglass history import PLANT FILE`: samples of another program for the gaps of a history, through the station while
//! it runs, else into the file.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::Ordering},
};

use jiff::Timestamp;

use super::{StoredPlant, open_log, record};
use crate::{
    access::{SessionRequest, io::audit_log},
    cli::{
        CliError, client, in_runtime, paths,
        progress::{Progress, cancelled_by_ctrl_c, wait_for},
        say,
        source::query_station,
    },
    history::{
        Answer, Overview, Query,
        import::Rows,
        io::{
            import::{self, read_rows},
            store::Store,
        },
    },
    plant::{PlantDef, recorded_action::RecordedAction},
    station::Session,
};

/// Arguments of `history import`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The first line names the columns: tag, time (or time_utc, utc, time_local), value, and if there are such \
    quality, unit and exact, whose number is the value. Or each row is an instant: a time, and a column for each tag by its \
    name, `TIC-1.PV` or `TIC-1.PV °C`, and perhaps one `TIC-1.PV quality`, as export writes them. Between the cells stand commas, semicolons or tabs. Times have an \
    offset, or are UTC where the column has utc in its name, else local times of the plant. A file has one decimal mark, that \
    of its first number, and none between thousands; between commas it is a point. What export --raw, sql --csv and --parquet write is \
    read as it was stored. Rows for which a value is in force already are left out; one error, and nothing is stored. An \
    import that was interrupted is completed by the same command."
)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
    /// A CSV or Parquet file with a row for each sample or instant
    file: PathBuf,
}

/// Reads the file, stores what fills a gap, and puts that on record.
pub fn main(args: &Args) -> Result<(), CliError> {
    let (def, station) = (args.plant.load()?, &args.plant.station);
    let file = std::path::absolute(&args.file).map_err(CliError::io(args.file.display().to_string()))?;
    in_runtime(async {
        match station.history.is_none() && client::find_station(Some(&def.name)).await.is_ok() {
            true => through_station(args, &def, &file).await,
            false => into_file(&def, &paths::history_file(&def, station), &file),
        }
    })
}

/// The station reads the file again, from its import folder: it opens no other for whoever asks. What is wrong with the file is
/// said before, to who may read it.
async fn through_station(args: &Args, def: &Arc<PlantDef>, file: &Path) -> Result<(), CliError> {
    let rows = count(&read_rows(file, def, Timestamp::UNIX_EPOCH, Timestamp::now()).map_err(refused)?);
    let session = client::attach(Some(&def.name), &args.plant.login).await?;
    let overview = overview(&session).await;
    let history =
        overview.as_ref().map_or_else(|| paths::history_file(def, &args.plant.station), |all| all.database.clone());
    let placed = import::place(file, &history).map_err(|error| {
        let folder = import::folder(&history);
        CliError::Failed(format!("the station imports files of {}: {error}; have it put there first", folder.display()))
    })?;
    let name = placed.name();
    let done = wait_for(session.request(SessionRequest::Import { file: name.clone() })).await;
    drop(placed);
    client::warn_not_recorded("imported", done?);
    let before = overview.map(|overview| overview.imports.len());
    match self::overview(&session).await.map(|overview| overview.imports).zip(before) {
        Some((imports, before)) => match imports[before..].iter().rfind(|import| import.file == name) {
            Some(import) => say(&format!("imported {}", import.summary(rows, &def.time_zone))),
            None => nothing(rows),
        },
        None => say(&format!("imported those of {rows} rows that had no stored value: the audit log has the counts")),
    }
    Ok(())
}

/// What is stored, for who may look.
async fn overview(session: &Session) -> Option<Overview> {
    match query_station(session, Query::Overview).await {
        Ok(Answer::Overview(overview)) => Some(*overview),
        Ok(_) | Err(_) => None,
    }
}

/// Ctrl-C ends it at its next piece.
fn into_file(def: &Arc<PlantDef>, path: &Path, file: &Path) -> Result<(), CliError> {
    let now = Timestamp::now();
    let opened = Store::open(path, def, now)?;
    if let Some(trouble) = opened.trouble {
        say(&trouble);
    }
    let store = opened.store;
    // Before the first row of this start, as a station does.
    store.end_curves_left_behind(now)?;
    let rows = read_rows(file, def, store.importable_from()?, now).map_err(refused)?;
    let all = count(&rows);
    let mut log = open_log(&audit_log::beside(path))?;
    let Some(mut importing) = store.importing(rows, &file.display().to_string(), now)? else {
        nothing(all);
        return Ok(());
    };
    let mut progress = Progress::new(importing.import.rows);
    let cancelled = cancelled_by_ctrl_c(|| {});
    let mut put_on_record = |outcome: String| {
        record(&mut log, RecordedAction::ImportSamples, &file.display().to_string(), &outcome, Timestamp::now())
    };
    while store.import_piece(&mut importing)? {
        progress.show(importing.done());
        if cancelled.load(Ordering::Relaxed) {
            let done = format!("cancelled: {} rows, the latest, are imported", importing.done());
            put_on_record(done.clone())?;
            return Err(CliError::Failed(format!("{done}; the same command imports the others")));
        }
    }
    drop(progress);
    store.checkpoint()?;
    let done = importing.summary(def);
    put_on_record(format!("done: {done}"))?;
    say(&format!("imported {done}"));
    Ok(())
}

fn count(rows: &Rows) -> u64 {
    rows.values().map(|rows| rows.len() as u64).sum()
}

fn nothing(rows: u64) {
    say(&format!("nothing to import: at each of {rows} rows a value is stored already"));
}

fn refused(problems: Vec<String>) -> CliError {
    CliError::Usage(format!("{}\nnothing is imported", problems.join("\n")))
}
