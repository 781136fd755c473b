//! Every problem of a profile, and every warning: where it stands, what was found, what was expected, and what was probably meant.

mod drawn_text;

use std::{collections::BTreeSet, fmt};

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, Report, Severity};

use self::drawn_text::DrawnText;
use crate::plant::visible::{same_length, visible};

/// Most problems that are drawn at once; the rest are counted.
const SHOWN_MAX: usize = 40;
/// Most problems that are kept: a file that has more is no plant file, and must not cost memory for each.
const KEPT_MAX: usize = 1_000;
/// A longer line is not drawn, only named: it was not written by a person.
const LINE_BYTES_MAX: usize = 1_000;
/// Most words that are compared for a suggestion.
const KNOWN_MAX: usize = 5_000;
/// Nothing of a longer text is drawn: each drawing reads all of it.
const DRAWN_BYTES_MAX: usize = 256 << 10;

/// Everything that is wrong with a plant file and its profiles, or everything that could be better, in the order of the
/// files.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    sources: Vec<Source>,
    list: Vec<Problem>,
    severity: Severity,
}

/// Draws the errors with file, line, column, the text in question and a caret.
/// `color` is for a terminal; without it the text is fit for a log or a pipe.
pub fn render(errors: &Errors, color: bool) -> String {
    let theme = if color { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_links(false).with_width(110);
    let mut out = String::new();
    for problem in errors.list.iter().take(SHOWN_MAX) {
        let report = problem.report(&errors.sources, errors.severity);
        // Writing into a string does not fail; should it ever, the plain message still gets out.
        if handler.render_report(&mut out, report.as_ref()).is_err() {
            out.push_str(&visible(&problem.message));
        }
        out.push('\n');
    }
    let hidden = errors.list.len().saturating_sub(SHOWN_MAX);
    if hidden > 0 {
        out.push_str(&format!("and {hidden} more {}s\n", errors.word()));
    }
    let count = errors.list.len();
    out.push_str(&format!("{count} {}{}\n", errors.word(), if count == 1 { "" } else { "s" }));
    out
}

impl Errors {
    /// A failure before any text could be looked at, such as a missing file.
    pub(crate) fn unreadable(message: String, help: String) -> Errors {
        Errors {
            sources: Vec::new(),
            list: vec![Problem {
                message,
                help: Some(help),
                at: None,
                label: String::new(),
                also: None,
                row: None,
                surplus: false,
            }],
            severity: Severity::Error,
        }
    }
    /// How many problems there are.
    pub fn count(&self) -> usize {
        self.list.len()
    }
    /// The same warnings, where they are not tolerated.
    pub fn strictly(self) -> Errors {
        Errors { severity: Severity::Error, ..self }
    }
    fn word(&self) -> &'static str {
        match self.severity {
            Severity::Error => "problem",
            Severity::Warning | Severity::Advice => "warning",
        }
    }
    /// Line and message of each, where it has a place.
    pub(crate) fn places(&self) -> impl Iterator<Item = (usize, String)> {
        self.list.iter().filter_map(|problem| {
            let at = problem.at?;
            let why = if problem.label.is_empty() { String::new() } else { format!(" ({})", problem.label) };
            Some((self.sources[at.source].position(at.start).0, format!("{}{why}", problem.message)))
        })
    }
    /// One line for each problem: `tank.toml:12:8: unknown line `L2``.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.list.iter().map(|problem| match problem.at {
            Some(at) => {
                let source = &self.sources[at.source];
                let (line, column) = source.position(at.start);
                visible(&format!("{}:{line}:{column}: {}", source.file, problem.message)).into_owned()
            }
            None => visible(&problem.message).into_owned(),
        })
    }
    /// The same with what was expected and what may have been meant, for places where the text itself is not shown.
    pub fn full_lines(&self) -> impl Iterator<Item = String> {
        self.lines().zip(&self.list).map(|(line, problem)| {
            let more = [problem.label.as_str(), problem.help.as_deref().unwrap_or("")];
            let more: Vec<&str> = more.into_iter().filter(|words| !words.is_empty()).collect();
            if more.is_empty() { line } else { format!("{line} ({})", visible(&more.join("; "))) }
        })
    }
}

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&render(self, false))
    }
}

impl std::error::Error for Errors {}

/// A text that was read, by the name the user knows it under.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Source {
    pub file: String,
    pub text: String,
}

impl Source {
    /// Line and column of a byte, both from 1; columns count characters.
    pub fn position(&self, byte: usize) -> (usize, usize) {
        let before = self.text.get(..byte).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
    /// Length of the longest line of the three around a byte, as they are drawn.
    fn line_bytes(&self, byte: usize) -> usize {
        let (before, after) = self.text.split_at_checked(byte).unwrap_or((&self.text, ""));
        let (mut back, mut ahead) = (before.rsplit('\n').map(str::len), after.split('\n').map(str::len));
        let own = back.next().unwrap_or(0) + ahead.next().unwrap_or(0);
        own.max(back.next().unwrap_or(0)).max(ahead.next().unwrap_or(0))
    }
}

/// A piece of one of the texts, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Span {
    pub source: usize,
    pub start: usize,
    pub end: usize,
}

/// A value and where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct At<T> {
    pub value: T,
    pub at: Span,
}

impl Span {
    /// The part of a quoted string that begins at its `skip`-th byte and is `length` bytes long.
    pub fn inside_quotes(self, skip: usize, length: usize) -> Span {
        let start = (self.start + 1 + skip).min(self.end);
        Span { start, end: (start + length).min(self.end), ..self }
    }
}

/// One problem.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    at: Option<Span>,
    message: String,
    label: String,
    also: Option<(Span, String)>,
    help: Option<String>,
    /// Of which row of a repeat it is; the same problem of the others is not reported.
    row: Option<String>,
    /// One of so many that it may not be kept: no work is worth it.
    surplus: bool,
}

impl Problem {
    /// Says it in other words.
    pub fn message(&mut self, text: impl Into<String>) -> &mut Self {
        self.message = text.into();
        self
    }
    /// What stands at the caret.
    pub fn label(&mut self, text: impl Into<String>) -> &mut Self {
        self.label = text.into();
        self
    }
    /// What to do about it.
    pub fn help(&mut self, text: impl Into<String>) -> &mut Self {
        self.help = Some(text.into());
        self
    }
    /// A second place that belongs to it, such as the first use of a name. Shown if it is in the same file.
    pub fn also(&mut self, at: Span, text: impl Into<String>) -> &mut Self {
        self.also = Some((at, text.into()));
        self
    }
    /// Offers the nearest of the known words, or all of them if they are few and none is near.
    pub fn suggest<'a>(&mut self, word: &str, known: impl IntoIterator<Item = &'a str>) -> &mut Self {
        if self.surplus {
            return self;
        }
        let known: Vec<&str> = known.into_iter().take(KNOWN_MAX).collect();
        match nearest(word, &known) {
            Some(near) => self.help(format!("did you mean `{near}`?")),
            None if known.is_empty() || known.len() > 12 => self,
            None => self.help(format!("known: {}", known.join(", "))),
        }
    }
    fn report(&self, sources: &[Source], severity: Severity) -> Report {
        let shown = |text: &str| visible(text).into_owned();
        let mut diagnostic = MietteDiagnostic::new(shown(&self.message)).with_severity(severity);
        diagnostic.help = self.help.as_deref().map(shown);
        let Some(at) = self.at else { return Report::new(diagnostic) };
        let source = &sources[at.source];
        if DRAWN_BYTES_MAX < source.text.len() || LINE_BYTES_MAX < source.line_bytes(at.start) {
            let (line, column) = source.position(at.start);
            diagnostic.message = format!("[{}:{line}:{column}] {}", shown(&source.file), diagnostic.message);
            return Report::new(diagnostic);
        }
        let second = self
            .also
            .iter()
            .filter(|(span, _)| span.source == at.source && source.line_bytes(span.start) <= LINE_BYTES_MAX);
        // The primary label is the place that the heading names.
        let primary = LabeledSpan::new_primary_with_span(Some(shown(&self.label)), at.start..at.end);
        let labels = std::iter::once(primary)
            .chain(second.map(|(span, text)| LabeledSpan::at(span.start..span.end, shown(text))));
        Report::new(diagnostic.with_labels(labels))
            .with_source_code(DrawnText { file: shown(&source.file), text: same_length(&source.text).to_string() })
    }
}

/// A message with these names left out.
fn without(message: &str, names: &BTreeSet<String>) -> String {
    let is_of_name = |letter: char| letter.is_alphanumeric() || "-_/#+.".contains(letter);
    let words = message.split_inclusive(|letter| !is_of_name(letter));
    words.filter(|word| !names.contains(word.trim_end_matches(|letter| !is_of_name(letter)))).collect()
}

/// Collects the problems while files are read, so that all of them come out at once.
#[derive(Debug, Default)]
pub(crate) struct Problems {
    sources: Vec<Source>,
    list: Vec<Problem>,
    warnings: Vec<Problem>,
    row: Option<String>,
    tags: BTreeSet<String>,
}

impl Problems {
    /// Registers a text; its number goes into every [`Span`].
    pub fn source(&mut self, file: &str, text: String) -> usize {
        self.sources.push(Source { file: file.to_owned(), text });
        self.sources.len() - 1
    }
    /// Bytes of all texts.
    pub fn bytes(&self) -> usize {
        self.sources.iter().map(|source| source.text.len()).sum()
    }
    /// The text of a source.
    pub fn text(&self, source: usize) -> &str {
        &self.sources[source].text
    }
    /// Adds a problem at a place.
    pub fn add(&mut self, at: Span, message: impl Into<String>) -> &mut Problem {
        push(&mut self.list, at, message.into(), self.row.clone())
    }
    /// Says of which row of a repeat the following problems are.
    pub fn of_row(&mut self, row: Option<String>) {
        self.row = row;
    }
    /// Knows what a tag is called: at one place, what is wrong with many of them is reported once, with the first of them.
    pub fn named(&mut self, name: String) -> String {
        self.tags.insert(name.clone());
        name
    }
    /// Reports two keys of which only one may stand, at the first.
    pub fn exclusive(&mut self, (first, at): (&str, Span), (second, other): (&str, Span)) {
        let problem = self.add(at, format!("`{first}` and `{second}` exclude each other"));
        problem.label("keep one of them").also(other, "the other");
    }
    /// Reports a name that stands for none of the known ones.
    pub fn unknown<'a>(&mut self, what: &str, name: &At<String>, known: impl IntoIterator<Item = &'a str>) {
        let problem = self.add(name.at, format!("unknown {what} `{}`", name.value));
        problem.label(format!("no such {what}")).suggest(&name.value, known);
    }
    /// Adds a warning at a place: the file can be used, but it could be better.
    pub fn warn(&mut self, at: Span, message: impl Into<String>) -> &mut Problem {
        push(&mut self.warnings, at, message.into(), self.row.clone())
    }
    /// How many there are by now.
    pub fn count(&self) -> usize {
        self.list.len()
    }
    /// The result, if there were no problems; else all problems in the order of the files.
    /// A profile that two devices use is read twice but complains once.
    pub fn finish<T>(self, value: T) -> Result<T, Errors> {
        self.finish_warned(value).map(|(value, _)| value)
    }
    /// The same, with the warnings.
    pub fn finish_warned<T>(self, value: T) -> Result<(T, Errors), Errors> {
        let good = self.list.is_empty();
        let (mut list, severity) = if good { (self.warnings, Severity::Warning) } else { (self.list, Severity::Error) };
        let kind = |problem: &Problem| without(&problem.message, &self.tags);
        list.sort_by_cached_key(|problem| (problem.at, kind(problem)));
        list.dedup_by(|other, first| {
            let same = *other == Problem { row: other.row.clone(), ..first.clone() };
            // Rows of a repeat, and devices with the same profile, differ in their names only.
            same || other.at.is_some()
                && other.at == first.at
                && other.message != first.message
                && kind(other) == kind(first)
        });
        for problem in &mut list {
            if let Some(row) = problem.row.take() {
                problem.message += &format!(" ({row})");
            }
        }
        let errors = Errors { sources: self.sources, list, severity };
        if good { Ok((value, errors)) } else { Err(errors) }
    }
}

fn push(list: &mut Vec<Problem>, at: Span, message: String, row: Option<String>) -> &mut Problem {
    // Beyond the limit the last one gives up its place.
    list.truncate(KEPT_MAX - 1);
    let surplus = list.len() == KEPT_MAX - 1;
    list.push(Problem { at: Some(at), message, label: String::new(), also: None, help: None, row, surplus });
    list.last_mut().expect("it was pushed one line above")
}

/// Longest word for which another is offered: the work grows with the product of their lengths.
const NEAR_CHARS_MAX: usize = 200;

/// The known word that was probably meant: at most one edit in three letters away.
pub(crate) fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let is_short = |word: &str| word.chars().nth(NEAR_CHARS_MAX).is_none();
    if !is_short(word) {
        return None;
    }
    let lower = word.to_lowercase();
    let distance = |candidate: &str| strsim::damerau_levenshtein(&lower, &candidate.to_lowercase());
    let allowed = (word.chars().count() / 3).max(1);
    // A one-letter word is one edit from every other: only its other case counts as near.
    let allowed = if word.chars().count() == 1 { 0 } else { allowed };
    known
        .iter()
        .filter(|candidate| is_short(candidate))
        .map(|candidate| (distance(candidate), *candidate))
        .filter(|(edits, _)| *edits <= allowed)
        .min()
        .map(|(_, near)| near)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_that_was_meant_is_offered_and_a_far_one_is_not() {
        let check = |word: &str, expect: Option<&str>| {
            assert_eq!(nearest(word, &["holding", "input", "coil", "l/min"]), expect, "{word}");
        };
        check("holdng", Some("holding"));
        check("HOLDING", Some("holding"));
        check("coils", Some("coil"));
        check("L/min", Some("l/min"));
        check("register", None);
        check("c", None);
        let long = "x".repeat(NEAR_CHARS_MAX);
        assert_eq!(nearest(&format!("{long}y"), &[&long]), None, "longer than any word that is known");
        assert_eq!(nearest("y", &["yes", &long]), None);
    }

    #[test]
    fn positions_count_lines_and_characters_from_one() {
        let source = Source { file: "a".into(), text: "ab\nü = 1\n".into() };
        assert_eq!(source.position(0), (1, 1));
        assert_eq!(source.position(3), (2, 1));
        assert_eq!(source.position(6), (2, 3), "ü is two bytes and one column");
        assert_eq!(source.position(99), (3, 1));
    }
}
