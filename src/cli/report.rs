//! `sightglass report`: the report of a shift or period from the history, through the station while it runs.

mod verify;

use std::path::{Path, PathBuf};

use clap::FromArgMatches;

use crate::{
    history::{Answer, Query},
    plant::PlantDef,
    report::{self, ReportFormat, ShiftReport, Style, content::document, document::Document},
    station::io::report_files::write_checksum,
    text::Language,
};

use super::{
    CliError, in_runtime, say_error,
    source::{CsvArgs, HistoryArgs, unexpected},
};

/// Arguments of `report`: those of a report to write, or `verify` with its own.
#[derive(Debug)]
pub enum Args {
    /// Write a report.
    Write(Box<WriteArgs>),
    /// Verify a file.
    Verify(verify::Args),
}

/// The word of the subcommand.
const VERIFY: &str = "verify";

// Derived, PLANT would be asked for beside the subcommand as well.
impl clap::Args for Args {
    fn augment_args(command: clap::Command) -> clap::Command {
        let verify = verify::Args::augment_args(clap::Command::new(VERIFY)).about(verify::ABOUT);
        let write = WriteArgs::augment_args(command).subcommand(verify);
        write.subcommand_negates_reqs(true).args_conflicts_with_subcommands(true).disable_help_subcommand(true)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Args::augment_args(command)
    }
}

impl FromArgMatches for Args {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Args, clap::Error> {
        match matches.subcommand_matches(VERIFY) {
            Some(matches) => verify::Args::from_arg_matches(matches).map(Args::Verify),
            None => WriteArgs::from_arg_matches(matches).map(|args| Args::Write(Box::new(args))),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = Args::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Arguments of a report to write.
#[derive(Debug, clap::Args)]
pub struct WriteArgs {
    #[command(flatten)]
    history: HistoryArgs,
    /// File to write, `-` for standard output; a folder for several formats [default: the plant's report folder]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    #[arg(long, value_name = "FORMATS", help = report::formats_help(), value_parser = report::format,
          value_delimiter = ',', default_value = report::FORMATS[0].name())]
    format: Vec<&'static dyn ReportFormat>,
    /// A file for each table, into this folder: as csv or parquet
    #[arg(long, value_name = "FOLDER", conflicts_with = "out")]
    tables: Option<PathBuf>,
    /// Language of its texts: en, th [default: that of the plant file]
    #[arg(long, value_name = "CODE", value_parser = language)]
    language: Option<Language>,
    #[command(flatten)]
    csv: CsvArgs,
}

fn language(code: &str) -> Result<Language, String> {
    let known = || Language::all().map(Language::code).collect::<Vec<_>>().join(", ");
    Language::from_code(code).ok_or_else(|| format!("expected one of {}", known()))
}

/// Writes the report, or verifies one.
pub fn main(args: Args) -> Result<(), CliError> {
    match args {
        Args::Write(args) => write(&args),
        Args::Verify(args) => verify::main(args),
    }
}

fn write(args: &WriteArgs) -> Result<(), CliError> {
    args.csv.refuse_unless(args.format.iter().any(|format| format.extension().ends_with("csv")))?;
    let def = args.history.load()?;
    if let Some(out) = &args.out {
        args.history.refuse_own_file(&def, out)?;
    }
    in_runtime(async {
        let (source, period) = args.history.open(&def).await?;
        let Answer::Report(report) = source.query(Query::Report { period }).await? else { return Err(unexpected()) };
        if report.unstored != Some(0) {
            say_error(
                "the history lacks records that wait, or that only the audit log has: what they say of the period is missing",
            );
        }
        for gap in &report.unreadable {
            let [from, to] = [gap.from, gap.to].map(|at| at.to_zoned(def.time_zone.clone()).strftime("%F %T"));
            say_error(&format!(
                "the history cannot be read from {from} to {to}, nothing is counted there: {}",
                gap.why
            ));
        }
        let language = args.language.unwrap_or_else(|| report::language(&def));
        let document = document(&report, &def, language.locale());
        for (path, bytes) in files(args, &def, &report, &document)? {
            source.export(&path, &bytes).await?;
            if path.as_os_str() != "-" {
                write_checksum(&path, &bytes).map_err(CliError::io(format!("no checksum of {}", path.display())))?;
            }
        }
        Ok(())
    })
}

/// What is written, and where.
fn files(
    args: &WriteArgs,
    def: &PlantDef,
    report: &ShiftReport,
    document: &Document,
) -> Result<Vec<(PathBuf, Vec<u8>)>, CliError> {
    let style = Style { csv: args.csv.dialect(def), ..Style::of(def) };
    let name = |format: &dyn ReportFormat| format.file_name(def, &report.period, report.until);
    if let Some(folder) = &args.tables {
        let tables = |format: &&'static dyn ReportFormat| {
            let (name, ending) = (name(*format), format!(".{}", format.extension()));
            let stem = name.strip_suffix(&ending).unwrap_or(&name).to_owned();
            let file = move |(table, bytes): (&str, Vec<u8>)| {
                (folder.join(format!("{stem}-{}{ending}", table.replace(' ', "-"))), bytes)
            };
            format.tables(document, &style).map(|tables| tables.into_iter().map(file)).map_err(CliError::Usage)
        };
        let tables = args.format.iter().map(tables).collect::<Result<Vec<_>, _>>()?;
        return Ok(tables.into_iter().flatten().collect());
    }
    let folder = match &args.out {
        None => Some(def.report.folder.as_path()),
        Some(out) => (args.format.len() > 1 || is_folder(out)).then_some(out.as_path()),
    };
    if args.format.len() > 1 && args.out.as_ref().is_some_and(|out| out.as_os_str() == "-") {
        return Err(CliError::Usage("standard output takes one format: give --out a folder".to_owned()));
    }
    let file = |format: &&'static dyn ReportFormat| {
        let bytes = format.render(document, &style).map_err(CliError::Failed)?;
        let path = folder.map(|folder| folder.join(name(*format))).or_else(|| args.out.clone());
        Ok((path.unwrap_or_default(), bytes))
    };
    args.format.iter().map(file).collect()
}

/// Is it a folder, or written as one?
fn is_folder(path: &Path) -> bool {
    path.is_dir() || path.to_string_lossy().ends_with('/')
}
