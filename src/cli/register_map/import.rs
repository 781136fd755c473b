//! `sightglass profile import`.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use crate::{
    cli::{CliError, say},
    plant::{
        address::{AddressBase, of_modicon},
        keyword::Keyword,
        live::ReplyTimes,
        tag::{ByteOrder, Table},
    },
    profile::{
        OwnProfiles,
        io::{atomic, regular},
        new_plant::{NewDevice, NewPlant, of_interest, usual_shifts},
    },
    register_map::{
        self, BYTES_MAX, Format,
        list::{Column, List, ListContext, Question, Unclear},
        profile::{self, Written},
    },
};

/// Lines of each kind that are said; all stand in no terminal.
const SAID_MAX: usize = 400;

/// Arguments of `profile import`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The register map; `-` reads standard input
    file: PathBuf,
    /// Format of the file, where it is not recognised: list, xlsx, html, homeassistant, esphome, telegraf, modbus_local_gateway, solarman,
    /// wb-mqtt-serial, sunspec, modbusscope, mtui, modmaster
    #[arg(long, value_parser = super::words::<Format>)]
    format: Option<Format>,
    /// The profile to write [default: the name of the file, in this folder]
    #[arg(long, short, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Write a plant file as well, with this device on a serial line
    #[arg(long, value_name = "FILE.toml")]
    plant: Option<PathBuf>,
    /// Table of the addresses that name none: coil, discrete, input, holding [default: holding, or that of a Modicon number]
    #[arg(long, value_parser = super::words::<Table>)]
    table: Option<Table>,
    /// How plain numbers count: modicon (40001 is the first), 0 (as sent), 1 (from 1) [default: as the file shows; else it is asked]
    #[arg(long, value_parser = base_of)]
    base: Option<AddressBase>,
    /// Byte order of the rows that name none: ABCD, CDAB, BADC, DCBA; the last two swap the bytes of a single register as well
    /// [default: ABCD; of a list of NIBE CDAB]
    #[arg(long, value_parser = super::words::<ByteOrder>)]
    order: Option<ByteOrder>,
    /// What a column of a list means, such as `Ratio=divisor`; `none`: ignore it. May be given several times
    #[arg(long, value_name = "HEADING=MEANING", value_parser = meaning_of)]
    column: Vec<(String, Option<Column>)>,
    /// The unit whose rows are taken, in a file of several [default: the first]
    #[arg(long, short)]
    unit: Option<u8>,
    /// Register of the first point of a SunSpec model, its ID [default: 40070; of the common model 40002]
    #[arg(long, value_name = "ADDRESS")]
    start: Option<u16>,
    /// Which model is meant, in a file of solarman that has values for several, from 0
    #[arg(long, value_name = "N")]
    variant: Option<usize>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

fn meaning_of(text: &str) -> Result<(String, Option<Column>), String> {
    let (heading, word) = text.rsplit_once('=').ok_or("expected HEADING=MEANING")?;
    let means = if word == "none" { Some(None) } else { Column::from_word(word).map(Some) };
    let words = Column::ALL.map(Column::word).join(", ");
    means.map(|means| (heading.to_owned(), means)).ok_or_else(|| format!("expected none, or one of: {words}"))
}

fn base_of(text: &str) -> Result<AddressBase, String> {
    match text {
        "modicon" => Ok(AddressBase::Modicon),
        "0" => Ok(AddressBase::Zero),
        "1" => Ok(AddressBase::One),
        _ => Err("expected modicon, 0 or 1".to_owned()),
    }
}

/// Reads, writes, and says what was taken and what was not.
pub fn main(args: &Args) -> Result<(), CliError> {
    let is_input = args.file.as_os_str() == "-";
    let (title, bytes) = if is_input { ("standard input".to_owned(), from_input()?) } else { from_file(&args.file)? };
    let context = ListContext {
        format: args.format,
        table: args.table.unwrap_or(Table::Holding),
        is_table_stated: args.table.is_some(),
        base: args.base,
        order: args.order,
        unit: args.unit,
        start: args.start,
        variant: args.variant,
        means: args.column.iter().cloned().collect(),
    };
    let list = register_map::read(&bytes, &context);
    if let Some(why) = &list.refused {
        return Err(CliError::Usage(format!("{title}: {why}")));
    }
    let stem = if is_input { "imported".to_owned() } else { name_of(&args.file) };
    let path = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{stem}.toml")));
    let name = profile_name(&path).unwrap_or_else(|| name_of(&path));
    check_free(&path, args)?;
    if let Some(plant) = &args.plant {
        if profile_name(&path).is_none() {
            let words = "no plant file can name this profile: --out with letters, digits, `_` and `-` alone";
            return Err(CliError::Usage(format!("{}: {words}", path.display())));
        }
        check_free(plant, args)?;
        if is_same_file(&path, plant) {
            return Err(CliError::Usage(format!("{} would be the profile and the plant file", plant.display())));
        }
    }
    if let Some(unclear) = &list.unclear {
        return Err(CliError::Usage(format!("{title}: {}", two_readings(unclear))));
    }
    let known = |heading: &str| list.columns.iter().any(|(known, _)| known.to_lowercase() == heading.to_lowercase());
    if let Some((heading, _)) = args.column.iter().find(|(heading, _)| !known(heading)) {
        let all: Vec<&str> = list.columns.iter().map(|(heading, _)| heading.as_str()).collect();
        return Err(CliError::Usage(format!("{title}: no column `{heading}`: it has {}", all.join(", "))));
    }
    if !list.questions.is_empty() {
        let all: Vec<String> = list.questions.iter().map(question).collect();
        return Err(CliError::Usage(format!("{title}: say what a column means:\n  {}", all.join("\n  "))));
    }
    let written = profile::written(&list, &name, &title);
    say_rows(&title, &list, written.as_ref().ok());
    let written = written.map_err(|why| CliError::Usage(format!("{title}: nothing of it can be imported: {why}")))?;
    let text = with_plant(args, &list, &name, &written)?;
    let was_there = path.exists();
    write(&path, written.text.as_bytes(), args.force)?;
    if let (Some(plant), Some(text)) = (&args.plant, text) {
        write(plant, text.as_bytes(), args.force).inspect_err(|_| {
            // What was not there before is not left half done.
            if !was_there {
                let _ = std::fs::remove_file(&path);
            }
        })?;
    }
    say_next(args, &path, &name, &written);
    Ok(())
}

fn from_input() -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let read = std::io::stdin().lock().take(BYTES_MAX + 1).read_to_end(&mut bytes);
    read.map_err(CliError::io("standard input"))?;
    if BYTES_MAX < bytes.len() as u64 {
        return Err(CliError::Usage(format!("standard input: larger than {} MiB", BYTES_MAX >> 20)));
    }
    Ok(bytes)
}

fn from_file(path: &Path) -> Result<(String, Vec<u8>), CliError> {
    let bytes = regular::read(path, BYTES_MAX).map_err(CliError::io(path.display().to_string()))?;
    let title = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
    Ok((title, bytes))
}

/// A name that a plant file can say: letters, digits, `_` and `-`.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    let name: String = stem.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    let name = name.trim_matches('_').to_owned();
    if name.is_empty() { "imported".to_owned() } else { name }
}

fn check_free(path: &Path, args: &Args) -> Result<(), CliError> {
    if path.exists() && !args.force {
        return Err(CliError::Usage(format!(
            "{} exists: --force overwrites it, --out names another file",
            path.display()
        )));
    }
    regular::check(path).map_err(CliError::io(path.display().to_string()))?;
    if path.extension().is_none_or(|extension| extension != "toml") {
        return Err(CliError::Usage(format!(
            "found `{}`, expected the name of a file such as meter.toml",
            path.display()
        )));
    }
    Ok(())
}

/// The name by which a plant finds the profile of a file: what stands before `.toml`, letter by letter; `None` where it has
/// signs that no such name has.
fn profile_name(path: &Path) -> Option<String> {
    let stem = path.file_stem()?.to_str()?;
    let is_plain = stem.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    is_plain.then(|| stem.to_owned())
}

/// Would both be one file, by whatever path?
fn is_same_file(one: &Path, other: &Path) -> bool {
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        path.canonicalize()
            .unwrap_or_else(|_| path.file_name().map_or_else(|| path.to_owned(), |name| folder.join(name)))
    };
    place(one) == place(other)
}

fn two_readings(unclear: &Unclear) -> String {
    let [first, second] = unclear.readings.map(|(base, (table, address))| {
        let base = match base {
            AddressBase::Modicon => "modicon",
            AddressBase::Zero => "0",
            AddressBase::One => "1",
        };
        format!("{} {address} (--base {base})", table.word())
    });
    format!("`{}` can be {first} or {second}: say which", unclear.written)
}

/// `Ratio (10): factor or divisor? --column "Ratio=factor", …`
fn question(question: &Question) -> String {
    let words = question.may_be.iter().map(|column| column.word()).chain(["none"]);
    let options: Vec<String> = words.map(|word| format!("--column \"{}={word}\"", question.heading)).collect();
    format!("{} {}", question.words(), options.join(", "))
}

/// What was taken, each row that was not, and what is lost of others.
fn say_rows(title: &str, list: &List, written: Option<&Written>) {
    let lost = written.map_or(&[][..], |written| &written.problems);
    let taken = written.map_or(0, |written| written.rows);
    let all = list.named.len() + list.calculated.len() + list.problems.len();
    let format = list.format.map_or("", Format::word);
    say(&format!("{title}: {format}, {taken} of {all} rows"));
    list.warnings.iter().for_each(|warning| say(&format!("  {warning}")));
    let problems: Vec<&String> = list.problems.iter().chain(lost).collect();
    problems.iter().take(SAID_MAX).for_each(|problem| say(&format!("  {problem}")));
    if SAID_MAX < problems.len() {
        say(&format!("  and {} more", problems.len() - SAID_MAX));
    }
    list.said_of_rows().for_each(|note| say(&format!("  {note}")));
    if let Some((_, unit)) = list.station {
        say(&format!("  the rows of unit {unit} are taken"));
    }
}

/// The text of a plant with this device.
fn with_plant(args: &Args, list: &List, name: &str, written: &Written) -> Result<Option<String>, CliError> {
    let Some(path) = &args.plant else { return Ok(None) };
    let plant = &written.checked.plant;
    let lines = plant.lines.iter().map(|line| (line.clone(), ReplyTimes::default())).collect();
    let device = NewDevice {
        name: "D-1".to_owned(),
        line: 0,
        unit: args.unit.or(list.station.map(|(_, unit)| unit)).filter(|unit| *unit != 0).unwrap_or(1),
        profile: Some((name.to_owned(), of_interest(&plant.tags))),
        unpolled: Vec::new(),
        controller: false,
        tags: Vec::new(),
    };
    let plant = NewPlant {
        title: name_of(path),
        time_zone: "UTC".to_owned(),
        lines,
        devices: vec![device],
        alarms: Vec::new(),
        shifts: usual_shifts(),
    };
    let profiles = OwnProfiles::of_text(name, &written.text);
    plant.text(&profiles).map(Some).map_err(|why| CliError::Usage(format!("{}: {why}", path.display())))
}

fn write(path: &Path, bytes: &[u8], force: bool) -> Result<(), CliError> {
    let written = if force { atomic::write_for_user(path, bytes).map(drop) } else { atomic::write_new(path, bytes) };
    written.map_err(CliError::io(path.display().to_string()))
}

fn say_next(args: &Args, path: &Path, name: &str, written: &Written) {
    let shown = path.display();
    say(&format!("written: {shown}, {} tags", written.checked.plant.tags.len()));
    let warnings = written.checked.warnings.count();
    let warned = if warnings == 0 { String::new() } else { format!(" ({warnings} warnings)") };
    say(&format!("next: sightglass check {shown}{warned}"));
    match &args.plant {
        Some(plant) => {
            say(&format!(
                "      {}: say port and baud of its line, then sightglass {}",
                plant.display(),
                plant.display()
            ));
        }
        None if profile_name(path).is_none() => {
            say("      no plant file can name this profile: call it NAME.toml, of letters, digits, `_` and `-` alone");
        }
        None => say(&format!(
            "      in a plant file beside it: [[device]] with profile = \"{name}\"; for all plants: ~/.config/sightglass/devices"
        )),
    }
    let is_modicon = written.checked.plant.tags.iter().any(|tag| of_modicon(&tag.point.address.to_string()).is_some());
    if is_modicon {
        say("      addresses in the profile are as sent (address_base = 0)");
    }
}
