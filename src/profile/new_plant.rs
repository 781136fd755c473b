//! The text of a new plant file: what a technician has found on a line, commented, and checked by reading it again.

use std::{fmt::Write, time::Duration};

use toml_edit::Value;

use super::{
    OwnProfiles, edit,
    tag_text::{quoted, tag_keys},
};
use crate::plant::{
    PlantDef,
    address::of_modicon,
    def::{LineDef, TagId},
    live::ReplyTimes,
    tag::{Access, Poll, TagDef},
};

/// Most values on the mimic, pens of the trend and tags of the report.
const SHOWN_MAX: usize = 34;
const PENS_MAX: usize = 4;
const REPORTED_MAX: usize = 12;
/// Tags that are of interest where a profile reads none often.
const INTEREST_MAX: usize = 34;
/// Values of a column of the mimic; cells of all of them, of one beside controllers, and of a name at least.
const ROWS: usize = 17;
const PICTURE_COLUMNS: usize = 78;
const LEFT_COLUMNS: usize = 47;
const NAME_COLUMNS: usize = 12;

/// What a new plant is made of.
#[derive(Debug, Clone)]
pub struct NewPlant {
    /// What the screens show.
    pub title: String,
    /// IANA name.
    pub time_zone: String,
    /// Its lines, with what their replies say of the timeout.
    pub lines: Vec<(LineDef, ReplyTimes)>,
    /// Its devices.
    pub devices: Vec<NewDevice>,
    /// Its alarms, beside those that every device and line has.
    pub alarms: Vec<NewAlarm>,
    /// Name and start of each shift, `day` and `06:00`.
    pub shifts: Vec<(String, String)>,
}

/// An alarm of a new plant.
#[derive(Debug, Clone, PartialEq)]
pub struct NewAlarm {
    /// Full name of its tag, `TIC-1.PV`.
    pub tag: String,
    /// `high` or `low`.
    pub condition: &'static str,
    /// In the unit of the tag.
    pub limit: f64,
    /// How far the value must come back.
    pub deadband: f64,
    /// Its name on the screens.
    pub message: String,
    /// Where the limit comes from.
    pub reason: &'static str,
    /// What may have happened, as far as the profile says; empty if it does not.
    pub cause: String,
}

/// A device of a new plant.
#[derive(Debug, Clone)]
pub struct NewDevice {
    /// `TIC-1`.
    pub name: String,
    /// Place of its line in [`NewPlant::lines`].
    pub line: usize,
    /// Unit address.
    pub unit: u8,
    /// Its profile, and the tags of it that are of interest; `None`: all it has are its own tags.
    pub profile: Option<(String, Vec<TagDef>)>,
    /// Tags of the profile that are never read.
    pub unpolled: Vec<String>,
    /// A controller: it has a faceplate.
    pub controller: bool,
    /// Tags that no profile has, by names of their own.
    pub tags: Vec<TagDef>,
}

impl NewPlant {
    /// The text, which loads without an error; else `Err` with the first errors, in words.
    pub fn text(&self, profiles: &OwnProfiles) -> Result<String, String> {
        let mut out = String::new();
        self.write(&mut out).map_err(|error| error.to_string())?;
        profiles.check("plant", &out).map_err(|errors| errors.full_lines().take(3).collect::<Vec<_>>().join("\n"))?;
        Ok(out)
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(
            out,
            "# Made by sightglass from what was found on the line. `sightglass check FILE` checks it after a change;"
        )?;
        writeln!(out, "# `sightglass profiles` lists device profiles, `sightglass help format` explains each key.\n")?;
        writeln!(out, "title = {}", quoted(&self.title))?;
        writeln!(
            out,
            "# Local time of shifts and reports, such as Asia/Bangkok.\ntime_zone = {}\n",
            quoted(&self.time_zone)
        )?;
        for (line, replies) in &self.lines {
            let learned = replies.timeout().map(|timeout| LineDef { timeout, ..line.clone() });
            if learned.is_some() {
                let slowest = replies.slowest.as_secs_f64() * 1e3;
                writeln!(
                    out,
                    "# The slowest of {} replies took {slowest:.1} ms; timeout_ms leaves a margin.",
                    replies.count
                )?;
            }
            writeln!(
                out,
                "[[line]]\nname = {}\n{}",
                quoted(&line.name),
                edit::line_text(learned.as_ref().unwrap_or(line))
            )?;
        }
        for device in &self.devices {
            self.device(out, device)?;
        }
        self.alarms(out)?;
        self.screens(out)?;
        for (name, start) in &self.shifts {
            writeln!(out, "[[shift]]\nname = {}\nstart = {}\n", quoted(name), quoted(start))?;
        }
        writeln!(out, "# Values are shown without logging in, until this is taken away; to act needs a user.")?;
        writeln!(out, "[access]\nanonymous_view = true\n")?;
        let tags: Vec<String> = self.shown().filter(|(_, tag)| is_number(tag)).map(|(name, _)| quoted(&name)).collect();
        let tags = tags.get(..REPORTED_MAX).unwrap_or(&tags);
        writeln!(out, "[report]\nfolder = \"reports\"\ntags = [{}]", tags.join(", "))
    }

    fn device(&self, out: &mut String, device: &NewDevice) -> std::fmt::Result {
        let line = self.lines.get(device.line).map_or("", |(line, _)| line.name.as_str());
        writeln!(out, "[[device]]\nname = {}", quoted(&device.name))?;
        if let Some((profile, _)) = &device.profile {
            writeln!(out, "profile = {}", quoted(profile))?;
        }
        writeln!(out, "line = {}\nunit = {}\nfast = \"1s\"\nslow = \"10s\"", quoted(line), device.unit)?;
        let polled = device.profile.iter().flat_map(|(_, tags)| tags);
        let polled: Vec<&TagDef> = polled.filter(|tag| tag.poll == Poll::Never).collect();
        if device.tags.is_empty() && polled.is_empty() && device.unpolled.is_empty() {
            return writeln!(out);
        }
        let (tags, left_out) = device.own_tags();
        // Only then do digits need it; another reader of the file sees that it was meant.
        if tags.iter().any(|tag| of_modicon(&tag.point.address.to_string()).is_some()) {
            writeln!(out, "address_base = 0")?;
        }
        writeln!(out, "# value = raw · scale + offset. Read only: access = \"rw\" lets an operator write a tag.")?;
        writeln!(out, "tag = [")?;
        for tag in polled {
            writeln!(out, "    {{ name = {}, poll = \"fast\" }},", quoted(&tag.short))?;
        }
        for name in &device.unpolled {
            writeln!(out, "    {{ name = {}, poll = \"never\" }},", quoted(name))?;
        }
        for tag in tags {
            writeln!(out, "    {{ {} }},", tag_text(tag))?;
        }
        for tag in left_out {
            writeln!(out, "    # overlaps another one: {{ {} }},", tag_text(tag))?;
        }
        writeln!(out, "]\n")
    }

    /// Alarms to begin with: every device and line has its own already; limits are for the plant's people to say.
    fn alarms(&self, out: &mut String) -> std::fmt::Result {
        writeln!(
            out,
            "# A device that does not respond and a line that is not connected raise an alarm without a word here."
        )?;
        for NewAlarm { tag, condition, limit, deadband, message, reason, cause } in &self.alarms {
            let [limit, deadband] = [limit, deadband].map(|value| Value::from(*value).to_string().trim().to_owned());
            writeln!(
                out,
                "# {reason}: is it the one of this plant?\n[[alarm]]\ntag = {}\n{condition} = {limit}\n\
                 deadband = {deadband}\non_delay = \"5s\"\npriority = \"high\"\nmessage = {}\ncause = {}\n\
                 # effect = \"\"\n# action = \"\"\n# response_time = \"10min\"\n",
                quoted(tag),
                quoted(message),
                quoted(cause)
            )?;
        }
        if !self.alarms.is_empty() {
            return Ok(());
        }
        let Some((name, _)) = self.shown().find(|(_, tag)| is_number(tag) && !tag.point.table.is_bits()) else {
            return writeln!(out);
        };
        writeln!(
            out,
            "# A limit, to be filled in and uncommented:\n# [[alarm]]\n# tag = {}\n# high = 80.0\n# deadband = 1.0\n\
             # on_delay = \"5s\"\n# priority = \"high\"\n# message = \"too high\"\n# cause = \"\"\n# effect = \"\"\n\
             # action = \"\"\n# response_time = \"10min\"\n",
            quoted(&name)
        )
    }

    fn screens(&self, out: &mut String) -> std::fmt::Result {
        let controllers: Vec<&NewDevice> = self.devices.iter().filter(|device| device.controller).take(2).collect();
        let shown: Vec<(String, &TagDef)> = self.shown().filter(|(_, tag)| !tag.is_text()).collect();
        let drawn = &shown[..shown.len().min(SHOWN_MAX)];
        // A picture without a cell is an error.
        if !drawn.is_empty() || !controllers.is_empty() {
            writeln!(out, "{}", picture(drawn, &controllers))?;
        }
        let pens = shown.iter().filter(|(_, tag)| is_number(tag)).take(PENS_MAX);
        let pens: Vec<String> = pens.map(|(name, _)| format!("    {{ tag = {} }},", quoted(name))).collect();
        if pens.is_empty() {
            return Ok(());
        }
        writeln!(out, "[[trend]]\nname = {}\npens = [\n{}\n]\n", quoted(&self.title), pens.join("\n"))
    }

    /// Every tag of interest with its full name.
    fn shown(&self) -> impl Iterator<Item = (String, &TagDef)> {
        self.devices.iter().flat_map(|device| {
            let of_profile = device.profile.iter().flat_map(|(_, tags)| tags);
            of_profile.chain(device.own_tags().0).map(|tag| (format!("{}.{}", device.name, tag.short), tag))
        })
    }
}

/// A picture to begin with: the values in columns, with the controllers beside them.
fn picture(shown: &[(String, &TagDef)], controllers: &[&NewDevice]) -> String {
    // Two columns where both leave each name some room; one beside controllers.
    let is_narrow = |width: usize| shown.iter().all(|(name, _)| NAME_COLUMNS + name.chars().count() + 4 <= width);
    let (columns, width) = match controllers {
        [] if is_narrow(PICTURE_COLUMNS / 2) => (2, PICTURE_COLUMNS / 2),
        [] => (1, PICTURE_COLUMNS),
        [..] => (1, LEFT_COLUMNS),
    };
    let cell = |row: usize, column: usize| {
        let (name, tag) = shown.get(column * ROWS + row).filter(|_| column < columns)?;
        let room = width.saturating_sub(name.chars().count() + 4).max(NAME_COLUMNS);
        let words = if room < tag.short.chars().count() && !tag.label.is_empty() { &tag.label } else { &tag.short };
        Some(format!("{} {{{name}}}", words.chars().take(room).collect::<String>().trim_end()))
    };
    let widest = (0..ROWS).filter_map(|row| cell(row, 0)).map(|text| text.chars().count()).max();
    let width = width.max(widest.unwrap_or(0));
    let mut rows: Vec<String> = Vec::new();
    for row in 0..ROWS {
        let right = match controllers.get(row / 7).filter(|_| row % 7 == 0) {
            Some(device) => Some(format!("{{controller {} 30x6}}", device.name)),
            None => cell(row, 1),
        };
        let text = format!(" {:<width$} {}", cell(row, 0).unwrap_or_default(), right.unwrap_or_default());
        rows.push(text.trim_end().to_owned());
    }
    let text = rows.join("\n");
    format!(
        "# Drawn as it will be shown: see `sightglass profiles --format`.\n[mimic]\npicture = '''\n{}\n'''\n",
        text.trim_end()
    )
}

impl NewDevice {
    /// Its own tags in the order of their addresses, and those that share a register with the one before.
    fn own_tags(&self) -> (Vec<&TagDef>, Vec<&TagDef>) {
        let mut tags: Vec<&TagDef> = self.tags.iter().collect();
        tags.sort_by_key(|tag| (tag.point.table, tag.point.address));
        let mut end = (None, 0);
        tags.into_iter().partition(|tag| {
            let (table, first) = (Some(tag.point.table), u32::from(tag.point.address));
            let free = end.0 != table || end.1 <= first;
            if free {
                end = (table, first + u32::from(tag.point.len()));
            }
            free
        })
    }
}

/// What a profile reads often; where it reads nothing by itself, the first that can be read.
pub fn of_interest(tags: &[TagDef]) -> Vec<TagDef> {
    // A power of ten says something with its values only.
    let powers: Vec<TagId> = tags.iter().filter_map(|tag| tag.decimals.power_source()).collect();
    let is_readable =
        |tag: &&TagDef| tag.access != Access::Write && tag.point.field.is_none() && !powers.contains(&tag.id);
    let readable = || tags.iter().filter(is_readable);
    let fast: Vec<TagDef> = readable().filter(|tag| is_fast(tag)).cloned().collect();
    if fast.is_empty() { readable().take(INTEREST_MAX).cloned().collect() } else { fast }
}

/// Is it read every second? Then it is measured, and no setting.
pub(super) fn is_fast(tag: &TagDef) -> bool {
    matches!(tag.poll, Poll::Every(period) if period <= Duration::from_secs(1))
}

/// Tags of a profile that are not kept and not needed by those that are: never read.
pub fn left_out(def: &PlantDef, kept: &[TagDef]) -> Vec<String> {
    let plates = def.devices.iter().filter_map(|device| device.faceplate.as_ref());
    let operated = plates.flat_map(|plate| {
        let some = [plate.sv_used, plate.mv, plate.run, plate.mode, plate.tune].into_iter().flatten();
        [plate.pv, plate.sv].into_iter().chain(some).chain(plate.tunes.iter().copied()).collect::<Vec<_>>()
    });
    let mut wanted: Vec<TagId> = kept.iter().map(|tag| tag.id).chain(operated).collect();
    let mut next = 0;
    while let Some(id) = wanted.get(next).copied() {
        let needs: Vec<TagId> = def.tag(id).needs().filter(|need| !wanted.contains(need)).collect();
        wanted.extend(needs);
        next += 1;
    }
    let rest = def.tags.iter().filter(|tag| tag.poll != Poll::Never && !wanted.contains(&tag.id));
    rest.map(|tag| tag.short.clone()).collect()
}

/// Two shifts of twelve hours.
pub fn usual_shifts() -> Vec<(String, String)> {
    [("day", "06:00"), ("night", "18:00")].map(|(name, start)| (name.to_owned(), start.to_owned())).to_vec()
}

fn is_number(tag: &TagDef) -> bool {
    !tag.is_text() && tag.enum_labels.is_empty()
}

/// The keys of a tag, read often.
fn tag_text(tag: &TagDef) -> String {
    let mut keys = tag_keys(tag);
    keys.push("poll = \"fast\"".to_owned());
    keys.join(", ")
}

/// What a tag may be called: letters, digits and `- _ / # + .`, anything else becomes `_`.
pub fn plain_name(text: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() || "-_/#+.".contains(c) { c } else { '_' };
    let name: String = text.trim().chars().map(letter).collect();
    if name.is_empty() { "_".to_owned() } else { name }
}
