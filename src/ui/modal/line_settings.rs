//! The communication settings of a line: tried out, taken back, saved into the plant file.

mod draft;
#[cfg(test)]
mod tests;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect, style::Style};

use super::{
    Modal, Next,
    faceplate::device_text,
    form::{Drawn, KeyOutcome},
    window,
};
use crate::{
    plant::{
        command::{CommandKind, Outcome},
        def::{LineDef, LineId},
        line_state::{DeviceState, LineState},
        number::to_u16,
    },
    ui::{
        UiAction, ViewContext, keys,
        keys::Hint,
        widgets::text::{fit, fit_words, wrap},
    },
};
use draft::{Draft, Setting};

#[derive(Debug, Clone, PartialEq)]
pub struct LineSettings {
    line: LineId,
    draft: Draft,
    /// What Enter will do, asked once more.
    asking: Option<SettingsAction>,
    problem: Option<String>,
}

/// What can be done here.
#[derive(Debug, Clone, PartialEq)]
enum SettingsAction {
    Apply(Box<LineDef>),
    Revert(Box<LineDef>),
    Save,
}

impl LineSettings {
    /// The settings in use of a line, to be changed.
    pub fn new(cx: &ViewContext, line: LineId) -> LineSettings {
        LineSettings { line, draft: Draft::new(in_use(cx, line)), asking: None, problem: None }
    }

    pub(super) fn hints(&self) -> Vec<Hint> {
        let escape = Hint::in_window(t!("Esc"), t!("close"));
        if self.asking.is_some() {
            return vec![Hint::in_window("⏎", t!("yes")), Hint::in_window("n", t!("no")), escape];
        }
        let form = &self.draft.form;
        let mut hints = vec![Hint::in_window("↑↓", t!("select"))];
        if form.is_on_choice() {
            hints.push(Hint::in_window("←→", t!("change")));
        }
        hints.push(Hint::in_window("⏎", t!("apply")));
        if !form.is_on_text() {
            hints.extend([Hint::in_window("u", t!("revert")), Hint::in_window("S", t!("save to plant file"))]);
        }
        hints.push(escape);
        hints
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if let Some(action) = self.asking.take() {
            let yes = keys::code(KeyCode::Enter).is(event) || keys::char('y').is(event);
            let acts = if yes { vec![UiAction::Command(self.command_kind(action))] } else { Vec::new() };
            // Off the text field, so that u and S are keys again.
            self.draft.form.select(0);
            return Next::Both(Modal::LineSettings(Box::new(self)), acts);
        }
        let asked = match self.draft.form.on_key(event) {
            KeyOutcome::Submitted => self.ask_apply(cx),
            KeyOutcome::Taken => self.on_change(event).map(|()| None),
            KeyOutcome::Ignored if keys::char('u').is(event) => self.ask_revert(cx),
            KeyOutcome::Ignored if keys::char('S').is(event) => self.ask_save(cx),
            KeyOutcome::Ignored if keys::char('q').is(event) => return Next::Close,
            KeyOutcome::Ignored => Ok(None),
        };
        self.problem = match asked {
            Ok(action) => {
                self.asking = action;
                None
            }
            Err(problem) => Some(problem),
        };
        Next::Stay(Modal::LineSettings(Box::new(self)))
    }

    fn on_change(&mut self, event: KeyEvent) -> Result<(), String> {
        let is_choice = matches!(event.code, KeyCode::Left | KeyCode::Right | KeyCode::Char(' '));
        match self.draft.form.selected() {
            n if is_choice && n == Setting::Mode as usize => self.draft.on_mode(),
            n if is_choice && n == Setting::DataBits as usize && !self.draft.has_data_bits() => {
                return Err(t!("Modbus RTU always has 8 data bits; 7 are for ASCII").to_owned());
            }
            _ => {}
        }
        Ok(())
    }

    pub(super) fn on_paste(&mut self, text: &str) {
        if self.asking.is_none() {
            self.draft.form.paste(text);
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let used = in_use(cx, self.line);
        let form = &self.draft.form;
        let room = body.width.saturating_sub(4).min(72);
        let (status, pinned) = (self.status(cx, used, room), self.pinned(cx, used, room));
        let title = t!("communication settings of {name}", name = used.name);
        let rows = usize::from(form.rows());
        let mut canvas = window(cx, frame, body, &title, (room, 1 + rows + 1 + status.len() + 1 + pinned.len()));
        // On a small screen: first the keys and what is asked, then the fields around the selected one, then the rest.
        let height = usize::from(canvas.height());
        let shown = rows.min(height.saturating_sub(1 + pinned.len()));
        let used_at = form.labels();
        let new_at = used_at + room.saturating_sub(used_at) / 2;
        canvas.text(used_at, 0, t!("in use"), theme.dim());
        canvas.text(new_at, 0, t!("new"), theme.dim());
        let old = Draft::new(used);
        for Drawn { field, y, end } in form.view(cx, &mut canvas, new_at, 1..to_u16(1 + shown)) {
            let before = old.words(field);
            canvas.text(used_at, y, &fit(&before, new_at.saturating_sub(used_at + 2)), theme.dim());
            canvas.text(end + 1, y, Setting::unit(field), theme.dim());
            if before != self.draft.words(field) {
                canvas.text_right(canvas.width(), y, t!("◂ changed"), theme.strong());
            }
        }
        let free = height.saturating_sub(1 + shown + pinned.len());
        let gap = usize::from(status.len() < free);
        canvas.rows(0, 1 + shown + gap, &status[..free.min(status.len())]);
        canvas.rows(0, height.saturating_sub(pinned.len()), &pinned);
    }

    /// How the line does with what it uses, and what can be taken back.
    fn status(&self, cx: &ViewContext, used: &LineDef, room: u16) -> Vec<(String, Style)> {
        let theme = cx.theme;
        let (answer, well) = answers(cx, self.line);
        let style = if well { theme.normal() } else { theme.trouble() };
        let mut rows: Vec<_> = wrap(&answer, room).into_iter().map(|row| (row, style)).collect();
        if let Some(why) = not_saved(cx, self.line) {
            rows.extend(wrap(&why, room).into_iter().map(|row| (row, theme.trouble())));
        }
        if let Some(before) = &cx.snapshot.line(self.line).settings_before {
            let words = t!("under test; before: {difference}", difference = difference(used, before));
            rows.extend(wrap(&words, room).into_iter().map(|row| (row, theme.normal())));
        }
        rows
    }

    /// The prompt, or what is wrong; and the keys.
    fn pinned(&self, cx: &ViewContext, used: &LineDef, room: u16) -> Vec<(String, Style)> {
        let theme = cx.theme;
        let (words, style) = match (&self.asking, &self.problem) {
            (Some(action), _) => (self.prompt(cx, used, action), theme.strong()),
            (None, Some(problem)) => (problem.clone(), theme.trouble()),
            (None, None) => (String::new(), theme.normal()),
        };
        let keys = match self.asking {
            Some(_) => t!("⏎ yes   n no"),
            None if self.draft.form.is_on_text() => t!("type it   ⏎ apply   Esc close"),
            None => t!("⏎ apply   u revert   S save to plant file   Esc close"),
        };
        let rows = wrap(&words, room).into_iter().map(|row| (row, style));
        rows.chain([(fit_words(keys, room), theme.strong())]).collect()
    }

    fn prompt(&self, cx: &ViewContext, used: &LineDef, action: &SettingsAction) -> String {
        let restart = t!("Polling restarts; values are bad until the devices respond.");
        match action {
            SettingsAction::Apply(new) => {
                t!("Apply {difference}? {restart}", difference = difference(used, new), restart)
            }
            SettingsAction::Revert(before) => {
                t!("Revert to {difference}? {restart}", difference = difference(used, before), restart)
            }
            SettingsAction::Save => {
                let (answer, well) = answers(cx, self.line);
                let doubt = if well { String::new() } else { format!("! {answer} ") };
                let title = &cx.def().title;
                t!(
                    "{doubt}Save {whole} to the plant file of {title}? The rest of the file is not changed.",
                    doubt,
                    whole = whole(used),
                    title
                )
            }
        }
    }

    fn command_kind(&self, action: SettingsAction) -> CommandKind {
        match action {
            SettingsAction::Apply(settings) | SettingsAction::Revert(settings) => CommandKind::Configure(settings),
            SettingsAction::Save => CommandKind::SaveSettings(self.line),
        }
    }

    fn ask_apply(&self, cx: &ViewContext) -> Result<Option<SettingsAction>, String> {
        let (used, new) = (in_use(cx, self.line), self.draft.settings()?);
        if new == *used {
            return Err(t!("these settings are active already; change one first").to_owned());
        }
        Ok(Some(SettingsAction::Apply(Box::new(new))))
    }

    fn ask_revert(&mut self, cx: &ViewContext) -> Result<Option<SettingsAction>, String> {
        let before = cx.snapshot.line(self.line).settings_before.as_ref();
        let before = before.ok_or(t!("nothing to revert: the settings were not changed"))?;
        self.draft = Draft::new(before);
        Ok(Some(SettingsAction::Revert(Box::new(LineDef::clone(before)))))
    }

    fn ask_save(&self, cx: &ViewContext) -> Result<Option<SettingsAction>, String> {
        let used = in_use(cx, self.line);
        if self.draft.settings()? != *used {
            return Err(t!("only active settings can be saved: apply these first (⏎)").to_owned());
        }
        if cx.snapshot.line(self.line).settings_before.is_none() {
            return Err(t!("nothing to save: the plant file has these settings").to_owned());
        }
        Ok(Some(SettingsAction::Save))
    }
}

/// The settings that a line works with now.
fn in_use<'a>(cx: &ViewContext<'a>, line: LineId) -> &'a LineDef {
    cx.snapshot.line(line).report.as_ref().map_or(cx.def().line(line), |report| &report.settings)
}

/// `RTU /dev/ttyUSB0 9600 8N1`, with the times where they differ.
fn difference(from: &LineDef, to: &LineDef) -> String {
    let mut words = to.transport.to_string();
    if from.timeout != to.timeout {
        words += &t!(", timeout {timeout} ms", timeout = to.timeout.as_millis());
    }
    if from.gap != to.gap {
        words += &t!(", gap {gap} ms", gap = to.gap.as_millis());
    }
    words
}

fn whole(settings: &LineDef) -> String {
    let (timeout, gap) = (settings.timeout.as_millis(), settings.gap.as_millis());
    t!("{transport}, timeout {timeout} ms, gap {gap} ms", transport = settings.transport, timeout, gap)
}

/// Whether the devices of a line answer, in words, and whether that is well.
fn answers(cx: &ViewContext, line: LineId) -> (String, bool) {
    let name = &cx.def().line(line).name;
    match &cx.snapshot.line(line).state {
        LineState::Connecting => (t!("{name} is connecting", name), true),
        LineState::Disconnected => (t!("{name} is disconnected: connect it with D on tab 4", name), false),
        LineState::NoTraffic => (t!("{name}: no traffic heard", name), false),
        LineState::Testing => (t!("{name} is in use by a test", name), true),
        LineState::Waiting { why, .. } => (t!("{name} is not connected: {why}", name, why), false),
        LineState::Connected => {
            let devices = cx.def().devices.iter().filter(|device| device.line == line);
            let well = |state| matches!(state, DeviceState::Responding | DeviceState::Unknown);
            let all_well = devices.clone().all(|device| well(cx.snapshot.device(device.id).state));
            let words: Vec<String> =
                devices.map(|device| format!("{} {}", device.name, device_text(cx, device.id))).collect();
            (t!("{name} connected: {join}", name, join = words.join("; ")), all_well)
        }
    }
}

/// Why the last request to save the settings of a line was refused, in full.
fn not_saved(cx: &ViewContext, line: LineId) -> Option<String> {
    let saved = cx.snapshot.commands.iter().find(|status| status.command.kind == CommandKind::SaveSettings(line))?;
    match &saved.outcome {
        Outcome::Refused(why) => Some(format!("! {why}")),
        Outcome::Pending
        | Outcome::Verified
        | Outcome::Unchanged
        | Outcome::Sent
        | Outcome::NotConfirmed(_)
        | Outcome::Failed(_) => None,
    }
}
