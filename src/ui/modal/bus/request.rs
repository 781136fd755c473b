//! Tests by their fields: a request, a loopback, an identification, a scan, registers. What is typed is checked at once.

mod fields;
mod functions;
mod signal;
mod sweep;

use fields::{all_settings, number};
use functions::FUNCTIONS;
use std::{ops::RangeInclusive, time::Duration};
pub use sweep::ask_sweep;

use crossterm::event::KeyEvent;
use ratatui::{Frame as Screen, layout::Rect, style::Style};

use super::{
    super::{
        Modal, Next, Notice, UiAction,
        form::{self, Field, Form, KeyOutcome},
        window,
    },
    Window,
    start::{self, TRANSACTION, TestKind},
};
use crate::{
    bus::{
        dissect::{self, Direction},
        frame::{self, hex},
        meaning, names, request_lint,
    },
    plant::{
        command::CommandKind,
        def::{Framing, LineDef, LineId, Parity, Serial},
        diagnostics::{Diagnostic, PATTERNS_MAX, Scan},
        number::{to_u8, to_u16, to_u32, to_u64},
        tag::Table,
    },
    t,
    text::translate,
    ui::{
        ViewContext,
        bus_text::ms,
        line_view::LineView,
        widgets::{
            list::on_screen,
            text::{pad, width, wrap},
        },
    },
};

/// Most characters of a field.
const CHARS: usize = 400;

#[derive(Debug, Clone, PartialEq)]
pub struct RequestForm {
    line: LineId,
    kind: TestKind,
    form: Form,
    problem: Option<String>,
}

const FUNCTION: usize = 1;

/// A form that makes sense: the test, and what it does in words.
type Built = (Diagnostic, Vec<String>);

/// Baud rates and characters that a scan over all settings tries, the usual ones first.
const BAUDS: [u32; 8] = [9_600, 19_200, 115_200, 38_400, 57_600, 4_800, 2_400, 1_200];
const CHARACTERS: [(Parity, u8); 4] = [(Parity::None, 1), (Parity::Even, 1), (Parity::Odd, 1), (Parity::None, 2)];

fn typed(label: &'static str, text: &str, range: &str) -> Field {
    Field::text(label, text, CHARS).within(range)
}

impl RequestForm {
    /// With what suits most.
    pub fn new(cx: &ViewContext, at: &LineView, kind: TestKind) -> RequestForm {
        let unit = cx.def().devices.iter().find(|device| device.line == at.id).map_or(1, |device| device.unit);
        let unit = typed(t!("unit"), &unit.to_string(), "");
        let fields = match kind {
            TestKind::Sweep => sweep::fields(unit),
            TestKind::Signal => signal::fields(),
            TestKind::Bytes | TestKind::Request => {
                let function = Field::choice(t!("function"), FUNCTIONS.map(dissect::function_words), 0);
                [vec![unit, function], functions::fields(FUNCTIONS[0], &|_| None)].concat()
            }
            TestKind::Loopback => vec![unit, typed(t!("times"), "10", "1 – 1000")],
            TestKind::Plug => vec![typed(t!("patterns"), "60", "1 – 500")],
            TestKind::Identify => vec![unit],
            TestKind::Scan => {
                let mut settings = vec![t!("current settings: {transport}", transport = at.settings.transport)];
                if at.settings.transport.serial().is_some() {
                    settings.push(t!("all baud rates and parities; polling pauses").to_owned());
                }
                let units = [typed(t!("from unit"), "1", ""), typed(t!("to unit"), "247", "")];
                let wait = typed(t!("wait ms"), "200", "10 – 10000");
                units.into_iter().chain([Field::choice(t!("settings"), settings, 0), wait]).collect()
            }
        };
        RequestForm { line: at.id, kind, form: Form::submitting(fields, 0), problem: None }
    }

    /// Is it for this test of this line?
    pub fn is(&self, line: LineId, kind: TestKind) -> bool {
        (self.line, self.kind) == (line, kind)
    }

    /// A key; what is filled in is kept for the next time.
    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        let function = self.form.chosen(FUNCTION);
        if self.form.on_key(event) == KeyOutcome::Submitted {
            self.problem = match self.start(cx) {
                Ok(act) => {
                    // It may have been opened on another tab.
                    let shown = UiAction::ShowTest(self.line);
                    let kept = UiAction::KeepTest(Box::new(Window::Form(self)));
                    return Next::Do(vec![act, shown, kept]);
                }
                Err(problem) => Some(problem),
            };
            return Window::Form(self).stay();
        }
        self.problem = None;
        if self.kind == TestKind::Request && function != self.form.chosen(FUNCTION) {
            let filled: Vec<(&str, String)> =
                (2..self.form.count()).map(|n| (self.form.label(n), self.form.text(n))).collect();
            let before = |label: &str| filled.iter().find(|(of, _)| *of == label).map(|(_, text)| text.clone());
            self.form.replace_from(2, functions::fields(FUNCTIONS[self.form.chosen(FUNCTION)], &before));
        }
        Window::Form(self).stay_and_keep()
    }

    pub fn on_paste(&mut self, text: &str) {
        self.form.paste(text);
    }

    fn start(&self, cx: &ViewContext) -> Result<UiAction, String> {
        let at = LineView::new(cx, self.line).ok_or(t!("this line no longer exists"))?;
        if self.form.is_cut() {
            return Err(form::cut());
        }
        let diagnostic = self.build(at.settings)?.0;
        start::start(cx, &at, diagnostic)
    }

    /// What a function takes of a field: of a choice its number.
    fn entry(&self, n: usize) -> String {
        self.form.choice(n).map_or_else(|| self.form.text(n), |chosen| chosen.to_string())
    }

    fn build(&self, line: &LineDef) -> Result<Built, String> {
        let framing = line.transport.framing();
        let top = if framing == Framing::Mbap { 255 } else { 247 };
        // Unit 0 of a serial line is a broadcast: it can be written to, and answers nothing.
        let least = if framing == Framing::Mbap || self.kind == TestKind::Request { 0 } else { 1 };
        let unit = |n: usize| number(&self.form.text(n), self.form.label(n), least..=top).map(to_u8);
        Ok(match self.kind {
            TestKind::Bytes | TestKind::Request => {
                let entries: Vec<String> = (2..self.form.count()).map(|n| self.entry(n)).collect();
                let message = functions::message(unit(0)?, FUNCTIONS[self.form.chosen(FUNCTION)], &entries)?;
                let words = request_text(&message, framing)?;
                (Diagnostic::Send(frame::wrap(framing, TRANSACTION, &message)), words)
            }
            TestKind::Loopback => {
                let (unit, count) = (unit(0)?, to_u16(number(&self.form.text(1), t!("times"), 1..=1_000)?));
                let words = t!("sends a word to unit {unit} and expects it back, {count} times", unit, count);
                (Diagnostic::Loopback { unit, data: 0xA537, count }, vec![words])
            }
            TestKind::Plug if framing == Framing::Mbap => {
                return Err(t!("Modbus TCP has no loopback plug: this needs a serial line").to_owned());
            }
            TestKind::Plug => {
                let count = to_u16(number(&self.form.text(0), t!("patterns"), 1..=i64::from(PATTERNS_MAX))?);
                let bits = line.transport.serial().map_or(8, |serial| serial.data_bits);
                let words = t!("sends {count} patterns of 32 bytes and compares what comes back", count);
                (Diagnostic::Pattern { bits, count }, vec![words])
            }
            TestKind::Identify => {
                let unit = unit(0)?;
                let words = t!("reads vendor, product and version of unit {unit}, or else its server id", unit);
                (Diagnostic::Identify { unit }, vec![words])
            }
            TestKind::Scan => self.build_scan(line, unit(0)?, unit(1)?)?,
            TestKind::Sweep => self.build_sweep(unit(0)?)?,
            TestKind::Signal => self.build_signal(line)?,
        })
    }

    fn build_scan(&self, line: &LineDef, first: u8, last: u8) -> Result<Built, String> {
        if last < first {
            return Err(t!("from unit {first} to unit {last}: the first is greater than the last", first, last));
        }
        let timeout = Duration::from_millis(to_u64(number(&self.form.text(3), t!("wait ms"), 10..=10_000)?));
        let serials = if self.form.chosen(2) == 1 { all_settings(line) } else { Vec::new() };
        let (units, settings) = (u32::from(last - first) + 1, to_u32(serials.len().max(1)));
        let longest = ms(timeout * units * settings);
        let words = t!(
            "{units} units, {settings} settings: about {longest} if no unit responds. Any response counts, also an exception.",
            units,
            settings,
            longest
        );
        Ok((Diagnostic::Scan(Scan { first, last, serials, timeout }), vec![words]))
    }

    pub fn view(&self, cx: &ViewContext, screen: &mut Screen, body: Rect) {
        let Some(at) = LineView::new(cx, self.line) else { return };
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let wrapped = |words: &str, style| wrap(words, room).into_iter().map(move |line| (line, style));
        let mut notes: Vec<(String, Style)> = match self.build(at.settings) {
            Ok((diagnostic, mut words)) => {
                words.extend(means(cx, &at, &diagnostic));
                words.iter().flat_map(|words| wrapped(words, theme.normal())).collect()
            }
            Err(why) => wrapped(&format!("! {why}"), theme.trouble()).collect(),
        };
        let problem = self.problem.clone().or_else(|| start::closed(&at));
        if let Some(why) = problem.filter(|why| !notes.iter().any(|(line, _)| line.ends_with(why.as_str()))) {
            notes.extend(wrapped(&format!("! {why}"), theme.trouble()));
        }
        let rows = self.form.rows();
        let mut canvas = window(cx, screen, body, self.title(), (room, rows + to_u16(notes.len()) + 3));
        // On a small screen the selected field is always seen, and the notes below are cut with a word.
        let last = canvas.height().saturating_sub(1);
        let shown = rows.min(last).max(1);
        self.form.view(cx, &mut canvas, self.form.labels(), 0..shown);
        let room = usize::from(last.saturating_sub(shown + 1));
        for (y, _, (line, style)) in on_screen(&notes, 0, room) {
            canvas.text(0, shown + 1 + y, line, *style);
        }
        if room < notes.len() {
            let more = t!(" {count} more lines: enlarge the screen", count = notes.len() - room);
            canvas.text_right(canvas.width(), last.saturating_sub(1), &more, theme.strong());
        }
        let keys = theme.enter(t!("↑↓ field   ←→ choose   ⏎ start   Esc close"));
        canvas.text(0, last, &pad(&keys, width(&keys)), theme.strong());
    }

    fn title(&self) -> &'static str {
        match self.kind {
            TestKind::Bytes | TestKind::Request => t!("request by fields"),
            TestKind::Loopback => t!("loopback"),
            TestKind::Plug => t!("loopback plug"),
            TestKind::Identify => t!("identify a device"),
            TestKind::Scan => t!("scan for units"),
            TestKind::Sweep => t!("map of addresses"),
            TestKind::Signal => t!("line signals"),
        }
    }
}

/// What a request means for the tags of the plant.
fn means(cx: &ViewContext, at: &LineView, diagnostic: &Diagnostic) -> Vec<String> {
    let Diagnostic::Send(bytes) = diagnostic else { return Vec::new() };
    let message = dissect::message_of(bytes, at.settings.transport.framing());
    message.map_or(Vec::new(), |message| meaning::of_request(cx.snapshot, at.id, &message))
}

/// The tables, by the first digit of their Modicon numbers.
const TABLES: [Table; 4] = [Table::Holding, Table::Input, Table::Coil, Table::Discrete];

/// The request in words, and its bytes; `Err` with what no device can take.
fn request_text(message: &[u8], framing: Framing) -> Result<Vec<String>, String> {
    if let Some(error) = request_lint::check_request(message, framing).first() {
        return Err(error.to_string());
    }
    let whole = frame::wrap(framing, TRANSACTION, message);
    let dissection = dissect::dissect(&whole, Some(framing), Some(Direction::Request), None);
    let effect = names::effect(message).map(|effect| t!("Effect: {effect}.", effect = translate(effect)));
    Ok([Some(dissection.summary), Some(hex(message)), effect].into_iter().flatten().collect())
}

#[cfg(test)]
mod tests;
