//! Asks for a reason or a note: of an acknowledgement, a suppression, a handover.

use crate::t;
use std::{sync::Arc, time::Duration};

use crossterm::event::KeyEvent;
use ratatui::{Frame, layout::Rect};

use super::{
    Modal, Next,
    form::{self, Field, Form, KeyOutcome},
    view_keys, window,
};
use crate::{
    plant::{
        alarm::{AlarmCommand, command::NOTE_CHARS_MAX},
        command::{Command, CommandKind},
        def::AlarmId,
        number::to_u16,
    },
    ui::{UiAction, ViewContext, keys::Hint, rights, widgets::text::wrap},
};

#[derive(Debug, Clone, PartialEq)]
pub struct Reason {
    title: String,
    /// What it is about.
    notes: Vec<String>,
    action: Intent,
    /// The words are its last field.
    form: Form,
    /// Nothing is done without words.
    needed: bool,
    /// What Enter does.
    verb: &'static str,
    problem: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
enum Intent {
    Command(CommandKind),
    /// These alarms are shelved for one of these times, or any up to the longest that the plant allows.
    Shelve(Arc<[AlarmId]>, Vec<Duration>, Duration),
}

/// The fields above the words where an alarm is shelved: one of a few times, and one that is typed.
const TIME: usize = 0;
const TYPED_TIME: usize = 1;
const TIME_CHARS: usize = 16;

impl Reason {
    /// An action with a text, which is required if `needed`.
    pub fn new(title: &str, verb: &'static str, notes: Vec<String>, kind: CommandKind, needed: bool) -> Reason {
        let words = words(needed);
        Reason::with(title, verb, notes, Intent::Command(kind), needed, Form::submitting(vec![words], 0))
    }

    /// Shelve alarms for one of these times, each with its words, or for any other up to `max`.
    pub fn shelve(notes: Vec<String>, alarms: &[AlarmId], times: Vec<(String, Duration)>, max: Duration) -> Reason {
        let (mut options, times): (Vec<String>, Vec<Duration>) = times.into_iter().unzip();
        options.push(t!("another time").to_owned());
        let first = if times.is_empty() { TYPED_TIME } else { TIME };
        let range = t!("45 min, 1.5 h, 1:30; at most {spelled}", spelled = spelled(max));
        let typed = Field::text(t!("other time"), "", TIME_CHARS).within(range);
        let form = Form::submitting(vec![Field::choice(t!("time"), options, 0), typed, words(true)], first);
        let action = Intent::Shelve(alarms.into(), times, max);
        let mut reason = Reason::with(t!("shelve an alarm"), t!("shelve"), notes, action, true, form);
        reason.fit();
        reason
    }

    fn with(title: &str, verb: &'static str, notes: Vec<String>, action: Intent, needed: bool, form: Form) -> Reason {
        Reason { title: title.to_owned(), notes, action, form, needed, verb, problem: None }
    }

    /// A time is typed only where none of the others is chosen.
    fn fit(&mut self) {
        if let Intent::Shelve(_, times, _) = &self.action {
            self.form.hide(TYPED_TIME, self.form.chosen(TIME) < times.len());
        }
    }

    pub fn hints(&self) -> Vec<Hint> {
        let select = (1 < self.form.rows()).then(|| Hint::in_window("↑↓", t!("select")));
        let change = self.form.is_on_choice().then(|| Hint::in_window("←→", t!("change")));
        let (enter, escape) = (Hint::in_window("⏎", self.verb), Hint::in_window(t!("Esc"), t!("cancel")));
        [Some(enter), select, change, Some(escape)].into_iter().flatten().collect()
    }

    pub(super) fn paste(&mut self, text: &str) {
        self.leave_choice();
        self.form.paste(text);
    }

    /// What is typed on a choice goes into the next field: the reason, or the time that is wanted instead.
    fn leave_choice(&mut self) {
        if self.form.is_on_choice() {
            self.form.select_next();
        }
    }

    /// What is done, once a time that is typed is one.
    fn command_kind(&self) -> Result<CommandKind, String> {
        match &self.action {
            Intent::Command(kind) => Ok(kind.clone()),
            Intent::Shelve(alarms, times, max) => {
                let chosen = times.get(self.form.chosen(TIME));
                let lasts = chosen.map_or_else(|| typed_time(&self.form.text(TYPED_TIME), *max), |lasts| Ok(*lasts))?;
                Ok(CommandKind::Alarm(AlarmCommand::Shelve { alarms: alarms.clone(), lasts }))
            }
        }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        match self.form.on_key(event) {
            KeyOutcome::Submitted => return self.finish(cx),
            KeyOutcome::Taken => self.problem = None,
            KeyOutcome::Ignored => {
                self.leave_choice();
                self.form.on_key(event);
            }
        }
        self.fit();
        Next::Stay(Modal::Reason(Box::new(self)))
    }

    fn finish(mut self, cx: &ViewContext) -> Next {
        let last = self.form.count() - 1;
        let (kind, words) = (self.command_kind(), self.form.text(last));
        self.problem = match &kind {
            Err(why) => {
                self.form.select(TYPED_TIME);
                Some(why.clone())
            }
            Ok(_) if self.form.is_cut() => Some(form::cut()),
            Ok(_) if self.needed && words.is_empty() => {
                self.form.select(last);
                Some(t!("a reason is required").to_owned())
            }
            Ok(_) if matches!(&self.action, Intent::Shelve(.., max) if typed_time(&words, *max).is_ok()) => {
                // Typed for the time, while another one was selected.
                Some(t!("a time is not a reason: select \"another time\" to enter a time").to_owned())
            }
            Ok(kind) => rights::missing(cx, kind),
        };
        match kind {
            Ok(kind) if self.problem.is_none() => {
                let note = (!words.is_empty()).then(|| Arc::from(words));
                Next::Do(vec![UiAction::SendCommand(Command { note, ..kind.into() }, None)])
            }
            Ok(_) | Err(_) => Next::Stay(Modal::Reason(Box::new(self))),
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let notes: Vec<String> = self.notes.iter().flat_map(|note| wrap(note, room)).collect();
        let (above, rows) = (to_u16(notes.len()), self.form.rows());
        let mut canvas = window(cx, frame, body, &self.title, (room, above + rows + 5));
        for (y, note) in notes.iter().enumerate() {
            canvas.text(0, to_u16(y), note, theme.normal());
        }
        self.form.view(cx, &mut canvas, self.form.labels(), above..above + rows);
        let missing = || self.command_kind().ok().and_then(|kind| rights::missing(cx, &kind));
        let problem = self.problem.clone().or_else(missing).unwrap_or_default();
        for (n, line) in wrap(&problem, room).iter().take(2).enumerate() {
            canvas.text(0, above + rows + 1 + to_u16(n), line, theme.trouble());
        }
        view_keys(cx, &mut canvas, &self.hints());
    }
}

fn words(needed: bool) -> Field {
    Field::text(if needed { t!("reason") } else { t!("note (optional)") }, "", NOTE_CHARS_MAX)
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
