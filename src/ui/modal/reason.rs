//! A deed that wants words: a note with an acknowledgement, the reason for putting an alarm aside, a note for the next shift.

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, line::Line, window};
use crate::{
    plant::{
        alarm::{AlarmCommand, command::WORDS_MAX},
        command::Command,
        def::AlarmId,
    },
    ui::{
        Act, Confirmed, Cx, keys, rights,
        widgets::text::{fit_words, wrap},
    },
};

/// The window.
#[derive(Debug, Clone, PartialEq)]
pub struct Reason {
    title: String,
    /// What it is about.
    notes: Vec<String>,
    /// What is done, one for each time that can be chosen; never empty.
    choices: Vec<(String, Command)>,
    chosen: usize,
    line: Line,
    /// Nothing is done without words.
    needed: bool,
    /// What Enter does.
    verb: &'static str,
    problem: Option<String>,
}

impl Reason {
    /// A deed with words; they are `needed` or may be left out.
    pub fn new(title: &str, verb: &'static str, notes: Vec<String>, command: Command, needed: bool) -> Reason {
        let choices = vec![(String::new(), command)];
        let (title, line) = (title.to_owned(), Line::long("", WORDS_MAX));
        Reason { title, notes, choices, chosen: 0, line, needed, verb, problem: None }
    }

    /// Shelve an alarm for one of these times, each with its words; `None` if there is none.
    pub fn shelve(notes: Vec<String>, alarm: AlarmId, times: Vec<(String, Duration)>) -> Option<Reason> {
        let command = |lasts| Command::Alarm(AlarmCommand::Shelve { alarm, lasts });
        let choices: Vec<_> = times.into_iter().map(|(words, lasts)| (words, command(lasts))).collect();
        let first = choices.first()?.1.clone();
        Some(Reason { choices, ..Reason::new("shelve an alarm", "shelve", notes, first, true) })
    }

    /// The keys of the moment.
    pub fn hints(&self) -> Vec<(&'static str, &'static str)> {
        let choose = (1 < self.choices.len()).then_some(("↑↓", "time"));
        [("⏎", self.verb)].into_iter().chain(choose).chain([("Esc", "leave it as it is")]).collect()
    }

    pub(super) fn paste(&mut self, text: &str) {
        self.line.paste(text);
    }

    pub(super) fn on_key(mut self, cx: &Cx, event: KeyEvent) -> Next {
        let last = self.choices.len() - 1;
        match event.code {
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => return self.finish(cx),
            KeyCode::Up => self.chosen = self.chosen.saturating_sub(1),
            KeyCode::Down => self.chosen = (self.chosen + 1).min(last),
            _ if self.line.on_key(event) => self.problem = None,
            _ => {}
        }
        Next::Stay(Modal::Reason(Box::new(self)))
    }

    fn finish(mut self, cx: &Cx) -> Next {
        let command = self.choices[self.chosen].1.clone();
        let words = self.line.text().trim().to_owned();
        self.problem = if self.line.missed() {
            Some("not all of it was taken; Ctrl-U empties the line".to_owned())
        } else if self.needed && words.is_empty() {
            Some("say why, in some words".to_owned())
        } else {
            rights::missing(cx, &command)
        };
        if self.problem.is_some() {
            return Next::Stay(Modal::Reason(Box::new(self)));
        }
        let note = (!words.is_empty()).then(|| Arc::from(words));
        Next::Do(vec![Act::Confirmed(Confirmed { note, ..command.into() })])
    }

    pub(super) fn view(&self, cx: &Cx, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let notes: Vec<String> = self.notes.iter().flat_map(|note| wrap(note, room)).collect();
        let times = if 1 < self.choices.len() { self.choices.len() as u16 } else { 0 };
        let height = notes.len() as u16 + times + 5;
        let mut canvas = window(cx, frame, body, &self.title, (room, height));
        for (y, note) in notes.iter().enumerate() {
            canvas.text(0, y as u16, note, theme.normal());
        }
        let mut y = notes.len() as u16;
        for (n, (words, _)) in self.choices.iter().enumerate().filter(|_| times > 0) {
            let style = if n == self.chosen { theme.focus() } else { theme.normal() };
            canvas.text(0, y, if n == self.chosen { "▸ " } else { "  " }, theme.strong());
            canvas.text(2, y, words, style);
            y += 1;
        }
        canvas.text(0, y, if self.needed { "reason:" } else { "note, if there is one:" }, theme.dim());
        self.line.view(theme, &mut canvas, 0, y + 1);
        let problem = self.problem.clone().or_else(|| rights::missing(cx, &self.choices[self.chosen].1));
        canvas.text(0, y + 2, &fit_words(&problem.unwrap_or_default(), room), theme.trouble());
        let keys: Vec<String> = self.hints().iter().map(|(key, label)| format!("{key} {label}")).collect();
        let keys = theme.enter(&keys.join("   "));
        canvas.text(0, canvas.height().saturating_sub(1), &keys, theme.strong());
    }
}
