//! Rows that a device has many times: strings of an inverter, relays, cells. One row stands for all of them.
//!
//! ```toml
//! [[repeat]]
//! names = ["1", "2", "3"]     # or count = 3
//! count_from = "N"            # the tag that says how many of them the device has
//! step = 20                   # added to `address` and `modicon` from one to the next
//!
//! [[repeat.tag]]
//! name = "MPPT{n}.W"          # {n}: its name, {i}: its place, from 0
//! address = 40284
//! ```

use super::{
    address::Scheme,
    diagnostic::Problems,
    reader::{At, Node, Raw},
    schema::RepeatTable,
    size::TAGS_MAX,
};
use crate::plant::address::{in_table, wire};

/// Most times that rows are repeated.
const COUNT_MAX: u16 = 1_000;

/// A row, and which of a repeat it is.
pub(super) type RepeatedRow = (At<Raw>, Option<String>);

/// The rows as written, and those of the repeats.
pub(super) fn all_rows(
    tags: &[At<Raw>],
    repeats: &[At<RepeatTable>],
    scheme: Scheme,
    problems: &mut Problems,
) -> Vec<RepeatedRow> {
    let mut rows: Vec<RepeatedRow> = tags.iter().map(|tag| (tag.clone(), None)).collect();
    for repeat in repeats.iter().map(|repeat| &repeat.value) {
        let names = names(repeat, problems);
        if repeat.tags.is_empty() && repeat.valid {
            problems.add(repeat.at, "a repeat needs rows").label("expected [[repeat.tag]] below it");
        }
        let count_from = repeat.count_from.as_ref();
        let step = repeat.step.map_or(0, |step| i128::from(step.value));
        for (place, name) in names.iter().enumerate() {
            let which = format!("`{name}`, {} of {} of a repeat", place + 1, names.len());
            let by = step * place as i128;
            // The plant then says that it has too many.
            if TAGS_MAX < rows.len() {
                break;
            }
            let row = |tag: &At<Raw>| {
                let row = repeated(tag, name, place, by, scheme);
                (count_from.map_or(row.clone(), |from| with_count(row, from, place)), Some(which.clone()))
            };
            rows.extend(repeat.tags.iter().map(row));
        }
    }
    rows
}

/// What each is called.
fn names(repeat: &RepeatTable, problems: &mut Problems) -> Vec<String> {
    let named: Vec<String> = repeat.names.iter().map(|name| name.value.clone()).collect();
    match (repeat.count, repeat.names.first()) {
        (Some(count), Some(first)) if usize::from(count.value) != named.len() => {
            let problem = problems.add(count.at, format!("{} names for a count of {}", named.len(), count.value));
            problem.label("one of them is enough").also(first.at, "the names");
            named
        }
        (_, Some(_)) => named,
        (Some(count), None) if (1..=COUNT_MAX).contains(&count.value) => {
            (1..=count.value).map(|number| number.to_string()).collect()
        }
        (Some(count), None) => {
            let problem = problems.add(count.at, format!("a count of {} is not possible", count.value));
            problem.label(format!("expected 1 to {COUNT_MAX}"));
            Vec::new()
        }
        (None, None) => {
            let problem = problems.add(repeat.at, "a repeat needs `count` or `names`");
            problem.label("missing here");
            Vec::new()
        }
    }
}

/// One of the rows that a row stands for.
fn repeated(row: &At<Raw>, name: &str, place: usize, by: i128, scheme: Scheme) -> At<Raw> {
    let mut row = row.clone();
    for (key, (_, node)) in &mut row.value.table {
        substitute(&mut node.value, name, place);
        if matches!(key.as_str(), "address" | "modicon") && by != 0 {
            node.value = moved(&node.value, by, scheme);
        }
    }
    row
}

/// The row as the device has it while it says that it has more than those before.
fn with_count(mut row: At<Raw>, from: &At<String>, place: usize) -> At<Raw> {
    let counted = format!("{} > {place}", from.value);
    let table = &mut row.value.table;
    match table.get_mut("when").map(|(_, node)| &mut node.value) {
        Some(Node::Text(own)) => *own = format!("({own}) and {counted}"),
        // What is no text is reported where it is read.
        Some(_) => {}
        None => {
            table.insert("when".to_owned(), (from.at, At { value: Node::Text(counted), at: from.at }));
        }
    }
    row
}

/// Puts name and place into every text.
fn substitute(node: &mut Node, name: &str, place: usize) {
    match node {
        Node::Text(text) if text.contains('{') => {
            *text = text.replace("{n}", name).replace("{i}", &place.to_string());
        }
        Node::Array(items) => items.iter_mut().for_each(|item| substitute(&mut item.value, name, place)),
        Node::Table(table) => table.values_mut().for_each(|(_, node)| substitute(&mut node.value, name, place)),
        Node::Text(_) | Node::Whole(_) | Node::Number(_) | Node::Flag(_) | Node::Time(_) => {}
    }
}

/// An address further on. What is none stays, and is reported where it is read.
fn moved(node: &Node, by: i128, scheme: Scheme) -> Node {
    let Node::Text(text) = node else {
        return if let Node::Whole(number) = node { Node::Whole(number + by) } else { node.clone() };
    };
    let digits = text.trim_start_matches(|letter: char| letter.is_ascii_uppercase());
    let (prefix, octal) = (&text[..text.len() - digits.len()], i128::from_str_radix(digits, 8));
    match (in_table(text), wire(text), scheme, octal) {
        (Some((table, address)), ..) => Node::Text(format!("{}:{}", table.word(), i128::from(address) + by)),
        (None, Some(_), ..) if text.len() == 5 && text.starts_with('0') && !text.contains(['x', 'X', 'h', 'H']) => {
            // A Modicon number of a coil, which a number of TOML cannot be.
            Node::Text(format!("{:05}", text.parse::<i128>().unwrap_or(0) + by))
        }
        (None, Some(address), ..) => Node::Whole(i128::from(address) + by),
        (None, None, Scheme::DirectLogic, Ok(number)) if !prefix.is_empty() => {
            Node::Text(format!("{prefix}{:o}", number + by))
        }
        (None, None, ..) => text.parse::<i128>().map_or_else(|_| node.clone(), |number| Node::Whole(number + by)),
    }
}
