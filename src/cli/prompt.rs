//! Queries in plain lines, one answer each: they work over SSH and in every terminal.

use std::io::{self, BufRead, IsTerminal, Write};

use super::CliError;
use crate::plant::visible::visible;

/// Whether someone can answer.
pub fn is_interactive() -> bool {
    io::stdin().is_terminal()
}

/// The answer to a query; Enter takes the usual one. Ctrl-C and the end of the input are an error.
pub async fn ask(query: &str, usual: &str) -> Result<String, CliError> {
    let _ = write!(io::stdout(), "{} [{}]: ", visible(query), visible(usual));
    let _ = io::stdout().flush();
    // A thread of its own, which nothing waits for when the program is left.
    let (sender, read) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let _ = sender.send(io::stdin().lock().read_line(&mut line).map(|read| (read, line)));
    });
    let stopped = || CliError::Failed("stopped; nothing was written".to_owned());
    let (read, line) = tokio::select! {
        line = read => line.map_err(|_| stopped())?.map_err(CliError::io("cannot read the answer"))?,
        _ = tokio::signal::ctrl_c() => return Err(stopped()),
    };
    match (read, line.trim()) {
        (0, _) => Err(stopped()),
        (_, "") => Ok(usual.to_owned()),
        (_, answer) => Ok(answer.to_owned()),
    }
}

/// Asks until the answer can be used; says what is wrong with the others.
pub async fn ask_until<T>(
    query: &str,
    usual: &str,
    mut take: impl FnMut(&str) -> Result<T, String>,
) -> Result<T, CliError> {
    loop {
        match take(&ask(query, usual).await?) {
            Ok(taken) => return Ok(taken),
            Err(why) => super::say(&why),
        }
    }
}

/// Is it agreed to? Enter means no.
pub async fn is_agreed(query: &str) -> Result<bool, CliError> {
    ask_until(&format!("{query}, yes or no"), "no", |answer| match answer {
        "yes" | "y" => Ok(true),
        "no" | "n" => Ok(false),
        _ => Err(format!("found `{answer}`, expected yes or no")),
    })
    .await
}

/// The places in a list that an answer means: `all`, `none`, or numbers from 1, ranges and names: `1 3-5 PV`.
pub fn selection(answer: &str, names: &[String]) -> Result<Vec<usize>, String> {
    let count = names.len();
    let mut chosen = match answer {
        "all" => (0..count).collect(),
        "none" => Vec::new(),
        _ => {
            let words = answer.split([' ', ',']).filter(|word| !word.is_empty());
            words.map(|word| one_of(word, names)).collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

fn one_of(word: &str, names: &[String]) -> Result<Vec<usize>, String> {
    let count = names.len();
    if let Some(at) = names.iter().position(|name| name == word) {
        return Ok(vec![at]);
    }
    let (first, last) = word.split_once('-').unwrap_or((word, word));
    match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(first @ 1..), Ok(last)) if first <= last && last <= count => Ok((first - 1..last).collect()),
        _ => Err(format!("found `{word}`, expected all, none, a name, or numbers from 1 to {count} such as 1 3-5")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_is_all_none_numbers_ranges_or_names() {
        let names = ["PV", "SV", "7", "MV"].map(str::to_owned);
        for (answer, expect) in [
            ("all", vec![0, 1, 2, 3]),
            ("none", vec![]),
            ("4, 1-2", vec![0, 1, 3]),
            ("SV 1", vec![0, 1]),
            ("7", vec![2]),
        ] {
            assert_eq!(selection(answer, &names), Ok(expect), "{answer}");
        }
        for wrong in ["0", "5", "3-2", "pv?", "1-9"] {
            assert!(selection(wrong, &names).is_err_and(|why| why.contains("expected all, none")), "{wrong}");
        }
    }
}
