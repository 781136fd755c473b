//! `sightglass new`: a plant file from answers and from what is found on the lines, checked by loading it.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::{civil::Time, tz::TimeZone};

use super::{
    CliError, in_runtime, log, menu, open, profile_choice,
    prompt::{ask, ask_until, selection},
    recognition::{FoundUnit, recognise_all},
    say,
    tools::{self, scan},
};
use crate::{
    bus::io::testing::Bench,
    plant::{
        PlantDef,
        def::{DeviceId, LineDef, TagId},
        diagnostics::{Diagnostic, DiagnosticState, Finding, Scan},
        live::ReplyTimes,
        tag::{Access, ByteOrder, DataType, Point, Table, TagDef},
    },
    profile::{
        OwnProfiles,
        io::atomic,
        new_plant::{NewAlarm, NewDevice, NewPlant, left_out, of_interest, plain_name},
        suggested_alarms::suggested_alarms,
        sunspec,
    },
};

/// More units than this on TCP are one device that answers to every address.
const UNITS_MANY: usize = 16;

/// Arguments of `new`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant file to write; an existing file is never overwritten
    #[arg(value_name = "FILE", default_value = "plant.toml")]
    file: PathBuf,
}

/// Asks, looks, and writes the plant file.
pub fn main(args: &Args) -> Result<(), CliError> {
    if !menu::is_asked() {
        let words = "`sightglass new` asks questions: run it in a terminal; `sightglass profiles tank` prints a plant file \
                     to start from";
        return Err(CliError::Usage(words.to_owned()));
    }
    let path = free(&args.file.to_string_lossy()).map_err(CliError::Usage)?;
    let _log = log::start(None, None)?;
    in_runtime(wizard(path))
}

/// The path of a plant file that is not there yet.
fn free(text: &str) -> Result<PathBuf, String> {
    let mut path = PathBuf::from(text);
    path.set_extension("toml");
    if path.file_stem().is_none() || path.is_dir() {
        return Err(format!("found `{text}`, expected the name of a file such as plant.toml"));
    }
    match path.exists() {
        true => Err(format!("{} exists already and is never overwritten: name another file", path.display())),
        false => Ok(path),
    }
}

async fn wizard(path: PathBuf) -> Result<(), CliError> {
    say("Enter accepts what is in [ ]. Nothing is written before the last question; Ctrl-C quits.");
    let mut profiles = open::own_profiles(path.parent().unwrap_or(Path::new("")));
    let known = profiles.recognisable();
    let title = ask("title", "Plant").await?;
    let here = TimeZone::system().iana_name().unwrap_or("UTC").to_owned();
    let time_zone = ask_until("time zone", &here, |name| match TimeZone::get(name) {
        Ok(_) => Ok(name.to_owned()),
        Err(_) => Err(format!("found `{name}`, expected an IANA name such as Asia/Bangkok")),
    })
    .await?;
    let (lines, devices, alarms) = (Vec::new(), Vec::new(), Vec::new());
    let mut plant = NewPlant { title, time_zone, lines, devices, alarms, shifts: Vec::new() };
    let (mut suggested, mut made) = (Vec::new(), Vec::new());
    while let Some(line) = next_line(plant.lines.len()).await? {
        let name = format!("L{}", plant.lines.len() + 1);
        let line = LineDef { name, ..line };
        let Some((found, replies)) = find_units(&line, &known).await? else { continue };
        for unit in &found {
            suggested.extend(add_device(&mut plant, unit, &mut profiles, (&mut made, &path)).await?);
        }
        plant.lines.push((line, replies));
    }
    if plant.lines.is_empty() {
        return Err(CliError::Usage("a plant needs a line; nothing was written".to_owned()));
    }
    plant.alarms = alarms_of(suggested).await?;
    plant.shifts = ask_until("shifts, or none", "day 06:00, night 18:00", shifts).await?;
    save(&plant, &profiles, &made, &path).await
}

/// Asks for a line until its settings are known; `None`: there are no more.
async fn next_line(count: usize) -> Result<Option<LineDef>, CliError> {
    const END: &str = "no more";
    let choices = menu::devices();
    if count == 0 {
        menu::show(&choices);
    }
    let usual = if count == 0 && !choices.is_empty() { "1" } else { END };
    let query = format!("line {}: number, HOST[:TCPPORT] or /dev/… --baud 19200", count + 1);
    loop {
        let parsed = ask_until(&query, usual, |answer| match answer {
            END => Ok(None),
            _ => open::Args::from_words(menu::chosen(answer, &choices)?).map(Some),
        });
        let Some(args) = parsed.await? else { return Ok(None) };
        let found = match args.line() {
            // Units are looked for later; only a serial line has settings to find.
            Ok(line) if line.transport.serial().is_none() => return Ok(Some(line)),
            Ok(line) => open::find(line, &args).await,
            Err(error) => Err(error),
        };
        match found {
            Ok((line, _)) => return Ok(Some(line)),
            Err(error) => say(&error.to_string()),
        }
    }
}

/// Scans a line and recognises who is there; `None` where it is left out.
async fn find_units(line: &LineDef, known: &[Arc<PlantDef>]) -> Result<Option<(Vec<FoundUnit>, ReplyTimes)>, CliError> {
    let usual = if line.transport.serial().is_some() { "1-32" } else { "1-247" };
    let (first, last) = ask_until("  units to look for", usual, scan::units).await?;
    let scan = Diagnostic::Scan(Scan { first, last, serials: Vec::new(), timeout: line.timeout });
    let run = tools::search(&mut Bench::new(line), scan, |_| false).await?;
    if let DiagnosticState::Failed(why) = &run.state {
        say(&format!("{why}; the line is left out"));
        return Ok(None);
    }
    let mut units = Vec::new();
    for finding in &run.findings {
        if units.len() < UNITS_MANY {
            scan::describe(finding).iter().for_each(|words| say(&format!("  {words}")));
        }
        if let Finding::Unit { unit, reply, .. } = finding
            && reply.is_certain()
        {
            units.push((*unit, reply.register().is_some()));
        }
    }
    let names: Vec<String> = units.iter().map(|(unit, _)| unit.to_string()).collect();
    if UNITS_MANY < names.len() {
        say(&format!("  … {} in all: is it one device that answers at every address?", names.len()));
    }
    let usual = if UNITS_MANY < names.len() { names[0].as_str() } else { "all" };
    let chosen = match names.len() {
        0 => {
            say("  no unit answers; the line is left out");
            return Ok(None);
        }
        1 => vec![0],
        _ => ask_until("  which of them", usual, |answer| unit_selection(answer, &names)).await?,
    };
    let chosen: Vec<(u8, bool)> = chosen.into_iter().filter_map(|at| units.get(at).copied()).collect();
    recognise_all(line, &chosen, known).await.map(Some)
}

/// Units are numbers themselves: a number is an address, not a place in the list.
fn unit_selection(answer: &str, names: &[String]) -> Result<Vec<usize>, String> {
    let is_known = |word: &str| ["all", "none"].contains(&word) || names.iter().any(|name| name == word);
    match answer.split([' ', ',']).find(|word| !word.is_empty() && !is_known(word)) {
        Some(word) => Err(format!("found `{word}`, expected all or some of {}", names.join(" "))),
        None => selection(answer, names),
    }
}

/// Asks for profile, name and tags of a unit; gives the alarms that its profile suggests.
async fn add_device(
    plant: &mut NewPlant,
    found: &FoundUnit,
    profiles: &mut OwnProfiles,
    (made, path): (&mut Vec<String>, &Path),
) -> Result<Vec<NewAlarm>, CliError> {
    let FoundUnit { unit, has_register, kind } = found;
    let profile = profile_choice::ask_profile(*unit, kind, profiles, made, names_beside(path)).await?;
    let controller = profile.iter().any(|def| def.devices.iter().any(|device| device.faceplate.is_some()));
    let usual = free_name(plant, if controller { "TIC" } else { "D" });
    let name = ask_until("  name", &usual, |name| {
        let taken = plant.devices.iter().any(|device| device.name == name);
        match name == plain_name(name).replace('.', "_") && !taken {
            true => Ok(name.to_owned()),
            false => {
                Err(format!("found `{name}`, expected a name that no other device has, of letters, digits, - and _"))
            }
        }
    })
    .await?;
    let mut device = NewDevice {
        name,
        line: plant.lines.len(),
        unit: *unit,
        profile: None,
        unpolled: Vec::new(),
        controller,
        tags: Vec::new(),
    };
    let mut alarms = Vec::new();
    if let Some(def) = profile {
        let is_made = made.contains(&def.name);
        let (kept, all) = if is_made { profile_choice::kept_models(&def).await? } else { kept_tags(&def).await? };
        alarms = suggested_alarms(&device.name, &kept);
        device.unpolled = left_out(&def, &kept);
        device.profile = Some((def.name.clone(), if all { of_interest(&kept) } else { kept }));
    } else if *has_register {
        say("  its register 0 is kept as R0; `sightglass open` shows the others, S saves them");
        let (table, kind, order) = (Table::Holding, DataType::U16, ByteOrder::Abcd);
        let point = Point { table, address: 0, kind, order, field: None };
        device.tags.push(TagDef::new(TagId(0), DeviceId(0), "R0", point));
    }
    plant.devices.push(device);
    Ok(alarms)
}

/// Names for a device profile beside a plant file, of files that are not there.
fn names_beside(plant: &Path) -> impl Iterator<Item = String> {
    let first = sunspec::profile_name(&plant.file_stem().unwrap_or_default().to_string_lossy());
    let names = (1..1_000).map(move |n| if n == 1 { first.clone() } else { format!("{first}_{n}") });
    names.filter(|name| !plant.with_file_name(format!("{name}.toml")).exists())
}

/// `TIC-1`, `TIC-2` …
fn free_name(plant: &NewPlant, stem: &str) -> String {
    let taken = |name: &String| plant.devices.iter().any(|device| device.name == *name);
    let names = (1..=plant.devices.len() + 1).map(|n| format!("{stem}-{n}"));
    names.into_iter().find(|name| !taken(name)).unwrap_or_else(|| stem.to_owned())
}

/// Which tags of a profile are kept, and whether these are all; the others are never read.
async fn kept_tags(def: &PlantDef) -> Result<(Vec<TagDef>, bool), CliError> {
    let tags: Vec<&TagDef> = def.tags.iter().filter(|tag| tag.access != Access::Write).collect();
    let names: Vec<String> = tags.iter().map(|tag| tag.short.clone()).collect();
    let numbered: Vec<String> = names.iter().enumerate().map(|(n, name)| format!("{:>3} {name:14}", n + 1)).collect();
    numbered.chunks(4).for_each(|row| say(&format!("  {}", row.join(" ").trim_end())));
    let chosen = ask_until("  tags to keep", "all", |answer| selection(answer, &names)).await?;
    let all = chosen.len() == tags.len();
    Ok((chosen.into_iter().filter_map(|at| tags.get(at).map(|tag| TagDef::clone(tag))).collect(), all))
}

/// Which of the suggested alarms are kept.
async fn alarms_of(suggested: Vec<NewAlarm>) -> Result<Vec<NewAlarm>, CliError> {
    if suggested.is_empty() {
        return Ok(suggested);
    }
    say("Every device and line has an alarm of its own already. The profiles suggest:");
    for (n, NewAlarm { tag, condition, limit, message, .. }) in suggested.iter().enumerate() {
        say(&format!("  {:>3}  {tag} {condition} {limit}: {message}", n + 1));
    }
    let names: Vec<String> = suggested.iter().map(|alarm| alarm.tag.clone()).collect();
    let chosen = ask_until("alarms to keep", "all", |answer| selection(answer, &names)).await?;
    Ok(chosen.into_iter().filter_map(|at| suggested.get(at).cloned()).collect())
}

/// `day 06:00, night 18:00`, or `none`.
fn shifts(answer: &str) -> Result<Vec<(String, String)>, String> {
    let one = |text: &str| {
        let (name, start) = text.trim().rsplit_once(' ')?;
        let time: Time = start.parse().ok()?;
        let whole = time.second() == 0 && time.subsec_nanosecond() == 0;
        (whole && !name.trim().is_empty()).then(|| (name.trim().to_owned(), time.strftime("%H:%M").to_string()))
    };
    if answer == "none" {
        return Ok(Vec::new());
    }
    let wrong =
        || format!("found `{answer}`, expected names with their starts such as day 06:00, night 18:00, or none");
    answer.split(',').map(one).collect::<Option<Vec<_>>>().ok_or_else(wrong)
}

/// Writes the text, which was loaded as a check, to a file that was not there.
async fn save(plant: &NewPlant, profiles: &OwnProfiles, made: &[String], path: &Path) -> Result<(), CliError> {
    let text = plant.text(profiles).map_err(|why| CliError::Failed(format!("nothing was written: {why}")))?;
    let usual = path.display().to_string();
    let path = ask_until("write the plant file", &usual, |answer| {
        let path = free(answer)?;
        let used = |name: &&String| plant.devices.iter().any(|of| of.profile.as_ref().is_some_and(|of| of.0 == **name));
        let beside = |name: &String| {
            (path.with_file_name(format!("{name}.toml")), profiles.text(name).unwrap_or_default().as_bytes().to_vec())
        };
        let mut files: Vec<(PathBuf, Vec<u8>)> = made.iter().filter(used).map(beside).collect();
        let made = files.len();
        files.push((path.clone(), text.as_bytes().to_vec()));
        atomic::write_all_new(&files).map_err(|(path, error)| format!("{}: {error}", path.display()))?;
        files[..made].iter().for_each(|(path, _)| say(&format!("saved {}: the device profile", path.display())));
        Ok(path)
    })
    .await?;
    let path = path.display();
    // As `check` counts them: with those that every device and line has.
    let alarms = profiles.check("plant", &text).map_or(0, |checked| checked.plant.alarms.len());
    let (lines, devices) = (plant.lines.len(), plant.devices.len());
    say(&format!("saved {path}: lines {lines}, devices {devices}, alarms {alarms}"));
    say(&format!("`sightglass {path}` shows it, `sightglass check {path}` its read plan"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::new_plant::usual_shifts;

    #[test]
    fn shifts_are_names_with_their_starts() {
        let pair = |name: &str, start: &str| (name.to_owned(), start.to_owned());
        assert_eq!(shifts("day 06:00, night 18:00"), Ok(usual_shifts()));
        assert_eq!(shifts("early shift 06:30"), Ok(vec![pair("early shift", "06:30")]));
        assert_eq!(shifts("none"), Ok(Vec::new()));
        for wrong in ["day", "day 25:00", "06:00", "day 06:00, "] {
            assert!(shifts(wrong).is_err_and(|why| why.contains("expected names")), "{wrong}");
        }
    }

    #[test]
    fn a_unit_is_chosen_by_its_address() {
        let units = ["3", "17", "40"].map(str::to_owned);
        assert_eq!(unit_selection("3 40", &units), Ok(vec![0, 2]));
        assert!(unit_selection("1", &units).is_err_and(|why| why.contains("some of 3 17 40")));
    }
}
