//! The table that a title names: the words above a part of a list, the name of a sheet.

use super::{codes, words::area_of};
use crate::plant::tag::Table;

/// More words than this are a sentence.
const WORDS_MAX: usize = 6;
/// Words that name a table whatever stands beside them.
const PHRASES: [(Table, &[&str], &[&str]); 7] = [
    (Table::Holding, &["holding"], &["register", "registers", "reg", "regs"]),
    (Table::Input, &["input"], &["register", "registers", "reg", "regs"]),
    (Table::Coil, &["coil", "coils"], &["status", "register", "registers", "output", "outputs"]),
    (Table::Coil, &["output", "outputs", "status"], &["coil", "coils"]),
    (Table::Discrete, &["discrete"], &["input", "inputs"]),
    (Table::Coil, &["discrete"], &["output", "outputs"]),
    (Table::Discrete, &["input"], &["status"]),
];
/// Words that name one where nothing else is said: `Cooling coil` and `Holding time` are of the plant, and `Inputs` are
/// terminals as well.
const WEAK: [(Table, &str); 5] = [
    (Table::Holding, "holding"),
    (Table::Input, "input"),
    (Table::Coil, "coil"),
    (Table::Coil, "coils"),
    (Table::Discrete, "discrete"),
];
#[rustfmt::skip]
const FILLERS: [&str; 34] = [
    "a", "address", "addresses", "all", "and", "or", "area", "bit", "bits", "code", "codes", "data", "fc", "function", "functions", "list", "map", "modbus", "number",
    "numbers", "of", "only", "r", "read", "readonly", "ro", "rw", "table", "tables", "the", "w", "writable", "write", "writeable",
];

/// `Input registers`, `3.1 Coils (read only)`, `Polled registers, FC 04`; `None` also for what may mean something else, or
/// several.
pub fn table_of(title: &str) -> Option<Table> {
    // The number of a chapter is no function code.
    let plain = title.trim_start_matches(|sign: char| !sign.is_alphabetic());
    let words: Vec<String> = title
        .to_lowercase()
        .replace(['/', '&', '+', ','], " and ")
        .split(|sign: char| !sign.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(|word| word.replace("inputreg", "input reg").replace("holdingreg", "holding reg"))
        .flat_map(|word| word.split(' ').map(str::to_owned).collect::<Vec<_>>())
        .collect();
    // A code alone is a cell of a row.
    let is_title = title.chars().filter(|sign| sign.is_alphabetic()).count() >= 4
        && plain.split_whitespace().count() <= WORDS_MAX
        && words.iter().all(|word| word != "not" && word != "no");
    if !is_title {
        return None;
    }
    let by_words = match one_of(phrases(&words)) {
        Ok(None) => weak(&words),
        Ok(found) => found,
        Err(()) => return None,
    };
    by_words.or_else(|| codes::table_in(plain))
}

/// The table that all of them are; `Err` where they are several.
fn one_of(tables: Vec<Table>) -> Result<Option<Table>, ()> {
    let first = tables.first().copied();
    if tables.iter().all(|table| Some(*table) == first) { Ok(first) } else { Err(()) }
}

fn phrases(words: &[String]) -> Vec<Table> {
    let has = |known: &[&str], word: Option<&String>| word.is_some_and(|word| known.contains(&word.as_str()));
    let at = |n: usize| {
        // A `Cooling coil` has a status too.
        let before = n.checked_sub(1).map(|before| words[before].as_str()).filter(|_| words[n] == "coil");
        if before.is_some_and(|word| !FILLERS.contains(&word) && !word.bytes().all(|byte| byte.is_ascii_digit())) {
            return None;
        }
        // `Input status registers` are registers.
        let is_of_registers = words[n] == "input" && has(&["register", "registers", "word", "words"], words.get(n + 2));
        let is = |(_, first, second): &&(Table, &[&str], &[&str])| {
            has(first, words.get(n))
                && has(second, words.get(n + 1))
                && !(has(&["status"], words.get(n + 1)) && is_of_registers)
        };
        let found = PHRASES.iter().find(is)?;
        // `Holding and input registers` are both.
        let is_joined = n.checked_sub(1).is_some_and(|before| has(&["and", "or"], words.get(before)));
        let other = n.checked_sub(2).and_then(|n| WEAK.iter().find(|(_, word)| *word == words[n]));
        Some([Some(found.0), other.filter(|_| is_joined).map(|(table, _)| *table)])
    };
    (0..words.len()).filter_map(at).flatten().flatten().collect()
}

/// The table of a title of weak words, areas such as `4x` and fillers alone.
fn weak(words: &[String]) -> Option<Table> {
    let is_registers = |word: &str| ["register", "registers", "reg", "regs"].contains(&word);
    // A `Coil 2` is one of a plant.
    let has_number = |word: &str| word.bytes().all(|byte| byte.is_ascii_digit());
    let is_one = words.iter().any(|word| word == "coil") && words.last().is_some_and(|word| has_number(word));
    let table = |word: &String| {
        let known = WEAK.iter().find(|(_, known)| known == word).map(|(table, _)| *table);
        known.or_else(|| area_of(word))
    };
    let has_coils = words.iter().any(|word| word == "coils");
    let is_filler = |word: &&String| {
        let is_output = has_coils && ["digital", "output", "outputs"].contains(&word.as_str());
        FILLERS.contains(&word.as_str()) || is_output || is_registers(word) || has_number(word)
    };
    let tables: Option<Vec<Table>> = words.iter().filter(|word| !is_filler(word)).map(table).collect();
    one_of(tables.filter(|_| !is_one)?).ok()?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_names_a_table_by_a_phrase_or_by_nothing_else() {
        for (title, table) in [
            ("Input registers", Table::Input),
            ("3.1 Input Registers (FC 04)", Table::Input),
            ("MODBUS_INPUT_REGISTER", Table::Input),
            ("Inputregister des Reglers", Table::Input),
            ("Measured values: input registers", Table::Input),
            ("Holding", Table::Holding),
            ("## Holding registers (read/write)", Table::Holding),
            ("4x registers", Table::Holding),
            ("Modbus table 3xxxx", Table::Input),
            ("Coils", Table::Coil),
            ("Coils (read and write)", Table::Coil),
            ("Coils / digital outputs", Table::Coil),
            ("Coil status", Table::Coil),
            ("Coil status registers", Table::Coil),
            ("Discrete outputs", Table::Coil),
            ("Discrete inputs", Table::Discrete),
            ("Input status", Table::Discrete),
            ("Polled registers (FC04)", Table::Input),
        ] {
            assert_eq!(table_of(title), Some(table), "{title}");
        }
        for title in [
            "Cooling coil",
            "Cooling coil status",
            "Coil 2",
            "Coil temps",
            "Fan coil unit 2",
            "Discrete manufacturing counters",
            "Holding time settings",
            "Inputs",
            "Outputs",
            "Input status registers",
            "Holding and input registers",
            "Holding/Input registers",
            "Coils and discrete inputs",
            "4x Pumps",
            "4x",
            "no coils",
            "4. Diagnostics",
        ] {
            assert_eq!(table_of(title), None, "{title}");
        }
    }
}
