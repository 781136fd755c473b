//! Asks for a reason or a note: of an acknowledgement, a suppression, a handover.

use crate::t;
use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, line::Line, view_keys, window};
use crate::{
    plant::{
        alarm::{AlarmCommand, command::NOTE_CHARS_MAX},
        command::{Command, CommandKind},
        def::AlarmId,
        number::to_u16,
    },
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        rights,
        widgets::text::wrap,
    },
};

/// The window.
#[derive(Debug, Clone, PartialEq)]
pub struct Reason {
    title: String,
    /// What it is about.
    notes: Vec<String>,
    /// What is done, one for each time that can be chosen; never empty.
    choices: Vec<(String, CommandKind)>,
    chosen: usize,
    /// The time that is typed where none of the choices is wanted: the last one then.
    time: Option<Time>,
    line: Line,
    /// Nothing is done without words.
    needed: bool,
    /// What Enter does.
    verb: &'static str,
    problem: Option<String>,
}

impl Reason {
    /// An action with a text, which is required if `needed`.
    pub fn new(title: &str, verb: &'static str, notes: Vec<String>, kind: CommandKind, needed: bool) -> Reason {
        let choices = vec![(String::new(), kind)];
        let (title, line) = (title.to_owned(), Line::long("", NOTE_CHARS_MAX));
        Reason { title, notes, choices, chosen: 0, time: None, line, needed, verb, problem: None }
    }

    /// Shelve alarms for one of these times, each with its words, or for any other up to `max`.
    pub fn shelve(notes: Vec<String>, alarms: &[AlarmId], times: Vec<(String, Duration)>, max: Duration) -> Reason {
        let alarms: Arc<[AlarmId]> = alarms.into();
        let kind = |lasts| CommandKind::Alarm(AlarmCommand::Shelve { alarms: alarms.clone(), lasts });
        let mut choices: Vec<_> = times.into_iter().map(|(words, lasts)| (words, kind(lasts))).collect();
        choices.push((t!("other:").to_owned(), kind(max)));
        let time = Some(Time { alarms: alarms.clone(), max, line: Line::default(), typing: choices.len() == 1 });
        let first = choices[0].1.clone();
        Reason { choices, time, ..Reason::new(t!("shelve an alarm"), t!("shelve"), notes, first, true) }
    }

    /// The keys of the moment.
    pub fn hints(&self) -> Vec<Hint> {
        let choose = (1 < self.choices.len()).then(|| Hint::in_window("↑↓", t!("select")));
        let other = self.other().map(|time| {
            Hint::in_window(t!("Tab"), if time.typing { t!("enter the reason") } else { t!("enter the time") })
        });
        let (enter, escape) = (Hint::in_window("⏎", self.verb), Hint::in_window(t!("Esc"), t!("cancel")));
        [enter].into_iter().chain(choose).chain(other).chain([escape]).collect()
    }

    pub(super) fn paste(&mut self, text: &str) {
        match self.time.as_mut().filter(|time| time.typing) {
            Some(time) => time.line.paste(text),
            None => self.line.paste(text),
        }
    }

    /// The time that is typed, where that is what is chosen.
    fn other(&self) -> Option<&Time> {
        self.time.as_ref().filter(|_| self.chosen + 1 == self.choices.len())
    }

    /// What is done, once a time that is typed is one.
    fn command_kind(&self) -> Result<CommandKind, String> {
        match self.other() {
            Some(time) => {
                let lasts = typed_time(&time.line.text(), time.max)?;
                Ok(CommandKind::Alarm(AlarmCommand::Shelve { alarms: time.alarms.clone(), lasts }))
            }
            None => Ok(self.choices[self.chosen].1.clone()),
        }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        let last = self.choices.len() - 1;
        match event.code {
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => return self.finish(cx),
            KeyCode::Up => self.choose(self.chosen.saturating_sub(1)),
            KeyCode::Down => self.choose((self.chosen + 1).min(last)),
            KeyCode::Tab if self.other().is_some() => {
                if let Some(time) = &mut self.time {
                    time.typing = !time.typing;
                }
            }
            _ => {
                let line = match self.time.as_mut().filter(|time| time.typing) {
                    Some(time) => &mut time.line,
                    None => &mut self.line,
                };
                if line.on_key(event) {
                    self.problem = None;
                }
            }
        }
        Next::Stay(Modal::Reason(Box::new(self)))
    }

    /// A time to be typed is typed first.
    fn choose(&mut self, chosen: usize) {
        self.chosen = chosen;
        let typing = self.other().is_some();
        if let Some(time) = &mut self.time {
            time.typing = typing;
        }
    }

    fn finish(mut self, cx: &ViewContext) -> Next {
        let kind = match self.command_kind() {
            Ok(kind) => kind,
            Err(why) => {
                self.problem = Some(why);
                return Next::Stay(Modal::Reason(Box::new(self)));
            }
        };
        if let Some(time) = &mut self.time {
            time.typing = false;
        }
        let words = self.line.text().trim().to_owned();
        self.problem = if self.line.missed() {
            Some(t!("the text was cut; Ctrl-U clears the line").to_owned())
        } else if self.needed && words.is_empty() {
            Some(t!("reason required").to_owned())
        } else if self.time.as_ref().is_some_and(|time| typed_time(&words, time.max).is_ok()) {
            // Typed for the time, while another one was selected.
            Some(t!("a time is not a reason: select \"other\" to enter a time").to_owned())
        } else {
            rights::missing(cx, &kind)
        };
        if self.problem.is_some() {
            return Next::Stay(Modal::Reason(Box::new(self)));
        }
        let note = (!words.is_empty()).then(|| Arc::from(words));
        Next::Do(vec![UiAction::SendCommand(Command { note, ..kind.into() }, None)])
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let notes: Vec<String> = self.notes.iter().flat_map(|note| wrap(note, room)).collect();
        let times = if 1 < self.choices.len() || self.time.is_some() { to_u16(self.choices.len()) } else { 0 };
        let height = to_u16(notes.len()) + times + 6;
        let mut canvas = window(cx, frame, body, &self.title, (room, height));
        for (y, note) in notes.iter().enumerate() {
            canvas.text(0, y, note, theme.normal());
        }
        let mut y = to_u16(notes.len());
        for (n, (words, _)) in self.choices.iter().enumerate().filter(|_| times > 0) {
            let style = if n == self.chosen { theme.focus() } else { theme.normal() };
            canvas.text(0, y, if n == self.chosen { "▸ " } else { "  " }, theme.strong());
            let x = canvas.text(2, y, words, style);
            if let Some(time) = self.time.as_ref().filter(|_| n + 1 == self.choices.len()) {
                let x = match self.other() {
                    Some(_) => time.line.view(theme, &mut canvas, x + 1, y),
                    None => x,
                };
                canvas.text(
                    x + 2,
                    y,
                    &t!("45 min, 1.5 h, 1:30; at most {spelled}", spelled = spelled(time.max)),
                    theme.dim(),
                );
            }
            y += 1;
        }
        canvas.text(0, y, if self.needed { t!("reason:") } else { t!("note (optional):") }, theme.dim());
        self.line.view(theme, &mut canvas, 0, y + 1);
        let problem = self.problem.clone().or_else(|| rights::missing(cx, &self.choices[self.chosen].1));
        for (n, line) in wrap(&problem.unwrap_or_default(), room).iter().take(2).enumerate() {
            canvas.text(0, y + 2 + to_u16(n), line, theme.trouble());
        }
        view_keys(cx, &mut canvas, &self.hints());
    }
}

/// A time that is typed.
#[derive(Debug, Clone, PartialEq)]
struct Time {
    alarms: Arc<[AlarmId]>,
    /// The longest that the plant allows.
    max: Duration,
    line: Line,
    /// What is typed goes here, not into the reason.
    typing: bool,
}

/// `45`, `45 min`, `1.5 h`, `1:30`: a time of at most `max`, a bare number in minutes.
fn typed_time(text: &str, max: Duration) -> Result<Duration, String> {
    let text = text.trim();
    let wrong = || t!("\"{text}\" is not a time: 45 min, 1.5 h or 1:30", text);
    let number = |text: &str| text.trim().replacen(',', ".", 1).parse::<f64>().ok();
    let minutes = match text.split_once(':') {
        Some((hours, minutes)) => {
            let minutes = minutes.parse::<u8>().ok().filter(|minutes| *minutes < 60);
            hours.parse::<u16>().ok().zip(minutes).map(|(hours, minutes)| f64::from(hours) * 60.0 + f64::from(minutes))
        }
        None => match text.strip_suffix('h') {
            Some(hours) => number(hours).map(|hours| hours * 60.0),
            None => number(text.strip_suffix("min").or(text.strip_suffix('m')).unwrap_or(text)),
        },
    };
    let lasts =
        minutes.and_then(|minutes| Duration::try_from_secs_f64((minutes * 60.0).round()).ok()).ok_or_else(wrong)?;
    match (lasts.is_zero(), lasts <= max) {
        (true, _) => Err(wrong()),
        (false, true) => Ok(lasts),
        (false, false) => Err(t!("at most {spelled}", spelled = spelled(max))),
    }
}

/// `90 min`, `8 h`.
pub fn spelled(span: Duration) -> String {
    match span.as_secs() / 60 {
        minutes if minutes % 60 == 0 => format!("{} h", minutes / 60),
        minutes => t!("{minutes} min", minutes),
    }
}

/// The name of what an alarm watches.
pub fn subject(cx: &ViewContext, alarm: crate::plant::def::AlarmId) -> String {
    crate::plant::alarm::manager::subject_name(cx.def(), cx.def().alarm(alarm).subject).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_typed_in_minutes_hours_or_both() {
        let max = Duration::from_secs(8 * 3_600);
        let minutes = |minutes: u64| Ok(Duration::from_secs(minutes * 60));
        for (text, lasts) in [
            ("45", minutes(45)),
            ("45 min", minutes(45)),
            ("1.5 h", minutes(90)),
            ("1,5h", minutes(90)),
            ("1:30", minutes(90)),
            (" 0:05 ", minutes(5)),
            ("8h", minutes(480)),
            ("9h", Err("at most 8 h".to_owned())),
            ("1:75", Err("\"1:75\" is not a time: 45 min, 1.5 h or 1:30".to_owned())),
            ("0", Err("\"0\" is not a time: 45 min, 1.5 h or 1:30".to_owned())),
            ("-5", Err("\"-5\" is not a time: 45 min, 1.5 h or 1:30".to_owned())),
            ("1e9", Err("at most 8 h".to_owned())),
            ("NaN", Err("\"NaN\" is not a time: 45 min, 1.5 h or 1:30".to_owned())),
            ("", Err("\"\" is not a time: 45 min, 1.5 h or 1:30".to_owned())),
        ] {
            assert_eq!(typed_time(text, max), lasts, "{text}");
        }
    }
}
