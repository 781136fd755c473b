//! What an operator reads of a failure: its cause in plain words. Those of the engine and of the system are for the log.

use super::engine_error;

/// Longest words for an operator, characters.
const CHARS_MAX: usize = 160;

/// The cause of a failure in one short line.
pub fn plain(message: &str) -> String {
    if let Some(label) = engine_error::label(message) {
        return label.to_owned();
    }
    // DuckDB puts the kind of the error before it, and advice and stack traces behind it.
    let line = message.lines().next().unwrap_or_default().trim();
    let kind = line.split_once(": ").filter(|(kind, _)| kind.ends_with(" Error") && kind.len() < 40);
    let words = kind.map_or(line, |(_, rest)| rest);
    // The number of a system error.
    let words = words.rsplit_once(" (os error ").map_or(words, |(text, _)| text);
    match words.char_indices().nth(CHARS_MAX) {
        Some((end, _)) => format!("{}…", words[..end].trim_end()),
        None => words.to_owned(),
    }
}

/// All that is wrong, in one line; `None` if nothing is.
pub fn joined<'a>(troubles: impl IntoIterator<Item = &'a Option<String>>) -> Option<String> {
    let troubles: Vec<&str> = troubles.into_iter().flatten().map(String::as_str).collect();
    (!troubles.is_empty()).then(|| troubles.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_cause_without_engine_details() {
        for (message, words) in [
            (
                "TransactionContext Error: Failed to commit: Could not write file \"/x/tank.duckdb.wal\": No space left on device",
                "the disk is full",
            ),
            ("/x/tank.duckdb.opening: Read-only file system (os error 30)", "the disk is read-only"),
            ("Permission denied (os error 13)", "no permission for its files"),
            (
                "FATAL Error: Failed: database has been invalidated because of a previous fatal error.\nOriginal error: \"No space left on device\"",
                "the disk is full",
            ),
            (
                "IO Error: Corrupt database file: computed checksum 1 does not match stored checksum 2 in block at location 3",
                "a damaged block, its checksum is wrong",
            ),
            (
                "IO Error: The file \"x\" exists, but it is not a valid DuckDB database file!\nmore",
                "The file \"x\" exists, but it is not a valid DuckDB database file!",
            ),
            ("File exists (os error 17)", "File exists"),
            ("too busy, try again", "too busy, try again"),
            ("line L1: a name with a colon", "line L1: a name with a colon"),
            ("", ""),
        ] {
            assert_eq!(plain(message), words, "{message}");
        }
        let long = plain(&format!("Binder Error: {}", "ä".repeat(500)));
        assert_eq!(long, format!("{}…", "ä".repeat(CHARS_MAX)));
    }
}
