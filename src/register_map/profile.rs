//! A register map as a device profile: what its check refuses is left out, and said.

mod sums;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
};

use super::{
    list::{List, words::poll_text},
    named::{Named, Repeat},
};
use crate::{
    plant::tag::{Access, TagDef},
    profile::{
        self, Checked,
        new_plant::plain_name,
        tag_text::{calculated_keys, quoted, tag_keys},
    },
    t,
};

/// How often a refused row is tried with less, or left out.
const ROUNDS_MAX: usize = 40;

/// A profile that can be written.
pub struct Written {
    /// Its text.
    pub text: String,
    /// What the check says of it.
    pub checked: Checked,
    /// What was left out of it, by line of the file that was read.
    pub problems: Vec<String>,
    /// Rows of the list that it has.
    pub rows: usize,
}

/// A row on its way into the profile.
struct Row {
    named: Named,
    tag: TagDef,
    /// Its limits and how it is written were refused.
    is_bare: bool,
    /// What it is calculated from, if it has no register.
    expr: Option<String>,
}

/// The profile of a list, called so; `Err` says why there is none.
pub fn written(list: &List, name: &str, source: &str) -> Result<Written, String> {
    let mut taken = BTreeSet::new();
    let mut rows: Vec<Row> = list.named.iter().map(|named| row(named, &mut taken)).collect();
    let mut problems = Vec::new();
    let parts = sums::add(&list.calculated, &mut rows, &mut taken, &mut problems);
    for _ in 0..ROUNDS_MAX {
        without_power(&mut rows, &mut problems);
        if rows.is_empty() {
            break;
        }
        let (text, lines) = text(list, &rows, name, source);
        let errors = match profile::check_text(name, &text) {
            Ok(checked) => {
                return Ok(Written { text, checked, problems, rows: rows.len().saturating_sub(parts) });
            }
            Err(errors) => errors,
        };
        let mut refused: Vec<(usize, String)> = Vec::new();
        for (line, why) in errors.places() {
            // The row is the last that begins at that line or above.
            match lines.partition_point(|start| *start <= line) {
                0 => return Err(why),
                n if refused.iter().all(|(row, _)| *row != n - 1) => refused.push((n - 1, why)),
                _ => {}
            }
        }
        if refused.is_empty() {
            return Err(errors.full_lines().next().unwrap_or_default());
        }
        refused.sort_by_key(|(row, _)| std::cmp::Reverse(*row));
        for (n, why) in refused {
            lessen(&mut rows, n, &why, &mut problems);
        }
    }
    Err(problems.pop().unwrap_or_else(|| t!("it is empty").to_owned()))
}

/// Leaves out the rows whose power of ten is left out: without it they would be another value.
fn without_power(rows: &mut Vec<Row>, problems: &mut Vec<String>) {
    let places: BTreeSet<_> = with_register(rows).map(|row| (row.named.table, row.named.address)).collect();
    rows.retain(|Row { named, .. }| {
        let is_whole = named.power_at.is_none_or(|at| places.contains(&(named.table, at)));
        if !is_whole {
            let (place, why) = (t!("line {number}", number = named.line), t!("its power of ten is left out"));
            problems.push(format!("{place}: {}: {why}", named.name));
        }
        is_whole
    });
}

/// Takes away what may be refused of a row; then the row.
fn lessen(rows: &mut Vec<Row>, n: usize, why: &str, problems: &mut Vec<String>) {
    let row = &mut rows[n];
    let place = t!("line {number}", number = row.named.line);
    let name = &row.named.name;
    let has_more = row.named.access != Access::Read || row.named.min.is_some() || row.named.max.is_some();
    if has_more && !row.is_bare {
        let bare =
            Named { access: Access::Read, min: None, max: None, write_fc: None, write_at: None, ..row.named.clone() };
        problems.push(format!("{place}: {}", t!("{name}: read only: {why}", name, why)));
        row.tag = TagDef { label: row.tag.label.clone(), ..bare.tag(&row.tag.short) };
        row.is_bare = true;
    } else {
        problems.push(format!("{place}: {name}: {why}"));
        rows.remove(n);
    }
}

fn row(named: &Named, taken: &mut BTreeSet<String>) -> Row {
    let plain = plain_name(&named.name);
    let place = format!("{plain}_{}", named.address);
    let bit = named.field.map(|(low, _)| format!("{place}_{low}"));
    let table = format!("{plain}_{}_{}", named.table.word(), named.address);
    let numbered = (2..).map(|n| format!("{plain}_{n}"));
    let mut names = [Some(plain.clone()), Some(place), bit, Some(table)].into_iter().flatten().chain(numbered);
    let short = names.find(|name| taken.insert(name.clone())).expect("the numbers do not end");
    Row { tag: named.tag(&short), named: named.clone(), is_bare: false, expr: None }
}

/// The keys of a row that stands for many: names of the first are those of each, and which of them a device has another tag
/// says.
fn repeated(keys: Vec<String>, repeat: &Repeat, counted_by: Option<&str>) -> Vec<String> {
    let first = format!("\"{}1.", plain_name(&repeat.prefix));
    let each = format!("\"{}{{n}}.", plain_name(&repeat.prefix));
    let is_name = |key: &str| ["name = ", "scale_from = "].iter().any(|name| key.starts_with(name));
    let of_each = |key: String| if is_name(&key) { key.replacen(&first, &each, 1) } else { key };
    let when = counted_by.map(|short| match repeat.counted_by.1 {
        None => format!("when = \"{short} >= {{n}}\""),
        Some(fixed) => format!("when = \"({short} - {fixed}) / {} >= {{n}}\"", repeat.step),
    });
    keys.into_iter().map(of_each).chain(when).collect()
}

fn with_register(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|row| row.expr.is_none())
}

/// The text, and the line in which each row begins.
fn text(list: &List, rows: &[Row], name: &str, source: &str) -> (String, Vec<usize>) {
    let mut out = String::new();
    let mut lines = Vec::new();
    // Writing into a string does not fail.
    let _ = writeln!(
        out,
        "# Imported by `sightglass profile import` from {source}: compare it with the manual of the device before it is relied on.\n\
         # `sightglass check FILE` checks it after a change, `sightglass help format` explains each key.\n"
    );
    let [vendor, model] = &list.about;
    for (key, text, usual) in [("vendor", vendor, "unknown"), ("model", model, name)] {
        let _ = writeln!(out, "{key} = {}", quoted(if text.is_empty() { usual } else { text }));
    }
    let _ = writeln!(
        out,
        "status = \"partial\"\nsource = {}\naddress_base = 0\ndefault = {{ confidence = \"low\" }}",
        quoted(&format!("imported from {source}"))
    );
    let powers: BTreeMap<_, _> =
        with_register(rows).map(|row| ((row.named.table, row.named.address), &row.tag.short)).collect();
    let mut line = out.matches('\n').count();
    let mut before = None;
    for Row { named, tag, expr, .. } in rows {
        let mut keys = expr.as_ref().map_or_else(|| tag_keys(tag), |expr| calculated_keys(tag, expr));
        keys.extend(named.poll.filter(|_| expr.is_none()).map(|poll| format!("poll = \"{}\"", poll_text(poll))));
        if let Some(power) = named.power_at.and_then(|at| powers.get(&(named.table, at))) {
            keys.retain(|key| !key.starts_with("decimals = "));
            keys.push(format!("scale_from = {}", quoted(power)));
        }
        let mut head = "\n[[tag]]".to_owned();
        if let Some(repeat) = &named.repeat {
            let counted_by = powers.get(&(named.table, repeat.counted_by.0));
            keys = repeated(keys, repeat, counted_by.map(|short| short.as_str()));
            head = "\n[[repeat.tag]]".to_owned();
            if before != Some(repeat) {
                head = format!("\n[[repeat]]\ncount = {}\nstep = {}\n{head}", repeat.count, repeat.step);
            }
        }
        before = named.repeat.as_ref();
        line += head.matches('\n').count() + 1;
        lines.push(line);
        line += keys.len();
        let _ = writeln!(out, "{head}\n{}", keys.join("\n"));
    }
    (out, lines)
}
