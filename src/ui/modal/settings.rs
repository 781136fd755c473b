//! The communication settings of a line: tried out, taken back, saved into the plant file.

mod draft;
#[cfg(test)]
mod tests;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect, style::Style};

use super::{Modal, Next, faceplate::device_text, window};
use crate::{
    plant::{
        command::{CommandKind, Outcome},
        def::{LineDef, LineId},
        event::LineState,
        number::to_u16,
        snapshot::DeviceState,
    },
    ui::{
        UiAction, ViewContext, keys,
        keys::Hint,
        widgets::text::{Canvas, fit, fit_words, width, wrap},
    },
};
use draft::{Draft, Field};

/// The form.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    line: LineId,
    draft: Draft,
    /// The selected row.
    row: usize,
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

impl Settings {
    /// The settings in use of a line, to be changed.
    pub fn new(cx: &ViewContext, line: LineId) -> Settings {
        // The speed is what differs most often.
        Settings { line, draft: Draft::new(in_use(cx, line)), row: 2, asking: None, problem: None }.in_range()
    }

    pub(super) fn hints(&self) -> Vec<Hint> {
        if self.asking.is_some() {
            return vec![
                Hint::in_window("⏎", t!("yes")),
                Hint::in_window("n", t!("no")),
                Hint::in_window(t!("Esc"), t!("close")),
            ];
        }
        let mut hints = vec![Hint::in_window("↑↓", t!("select"))];
        if self.field().is_choice() {
            hints.push(Hint::in_window("←→", t!("change")));
        }
        hints.push(Hint::in_window("⏎", t!("apply")));
        if !self.field().is_text() {
            hints.extend([Hint::in_window("u", t!("revert")), Hint::in_window("S", t!("save to plant file"))]);
        }
        hints.push(Hint::in_window(t!("Esc"), t!("close")));
        hints
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        let enter = keys::code(KeyCode::Enter).is(event);
        if let Some(action) = self.asking.take() {
            let yes = enter || keys::char('y').is(event);
            let acts = if yes { vec![UiAction::Command(self.command_kind(action))] } else { Vec::new() };
            // Off the text field, so that u and S are keys again.
            self.row = 0;
            return Next::Both(Modal::Settings(Box::new(self)), acts);
        }
        self.problem = None;
        let asked = match event.code {
            KeyCode::Enter if enter => self.ask_apply(cx),
            KeyCode::Up => self.select(-1),
            KeyCode::Down | KeyCode::Tab => self.select(1),
            KeyCode::Left if self.field().is_choice() => self.draft.step(self.field(), -1),
            KeyCode::Right if self.field().is_choice() => self.draft.step(self.field(), 1),
            KeyCode::Char(' ') if self.field().is_choice() => self.draft.step(self.field(), 1),
            _ if self.draft.on_key(self.field(), event) => Ok(None),
            KeyCode::Char('u') if keys::char('u').is(event) => self.ask_revert(cx),
            KeyCode::Char('S') if keys::char('S').is(event) => self.ask_save(cx),
            KeyCode::Char('q') => return Next::Close,
            _ => Ok(None),
        };
        match asked {
            Ok(action) => self.asking = action,
            Err(problem) => self.problem = Some(problem),
        }
        Next::Stay(Modal::Settings(Box::new(self.in_range())))
    }

    pub(super) fn on_paste(&mut self, text: &str) {
        let field = self.field();
        if self.asking.is_none() {
            self.draft.paste(field, text);
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let used = in_use(cx, self.line);
        let fields = self.draft.fields();
        let room = body.width.saturating_sub(4).min(72);
        let (status, pinned) = (self.status(cx, used, room), self.pinned(cx, used, room));
        let title = t!("communication settings of {name}", name = used.name);
        let wanted = 1 + fields.len() + 1 + status.len() + 1 + pinned.len();
        let mut canvas = window(cx, frame, body, &title, (room, wanted));
        // On a small screen: first the keys and what is asked, then the fields around the selected one, then the rest.
        let height = usize::from(canvas.height());
        let shown = fields.len().min(height.saturating_sub(1 + pinned.len()));
        let first = (self.row + 1).saturating_sub(shown);
        let used_at = fields.iter().map(|field| width(field.name()) + 3).max().unwrap_or(0).max(NAME);
        let new_at = used_at + room.saturating_sub(used_at) / 2;
        canvas.text(used_at, 0, t!("in use"), theme.dim());
        canvas.text(new_at, 0, t!("new"), theme.dim());
        let old = Draft::new(used);
        for (y, (n, field)) in fields.iter().enumerate().skip(first).take(shown).enumerate() {
            let y = to_u16(y) + 1;
            let selected = n == self.row && self.asking.is_none();
            canvas.text(2, y, field.name(), if selected { theme.focus() } else { theme.normal() });
            let before = old.words(*field);
            canvas.text(used_at, y, &fit(&before, new_at.saturating_sub(used_at + 2)), theme.dim());
            self.value(cx, &mut canvas, (new_at, y), *field, selected, before != self.draft.words(*field));
        }
        let free = height.saturating_sub(1 + shown + pinned.len());
        let gap = usize::from(status.len() < free);
        canvas.rows(0, 1 + shown + gap, &status[..free.min(status.len())]);
        canvas.rows(0, height.saturating_sub(pinned.len()), &pinned);
    }

    /// The new value of a field: a text with its cursor, or a choice between arrows; bold where it differs.
    fn value(
        &self,
        cx: &ViewContext,
        canvas: &mut Canvas,
        (x, y): (u16, u16),
        field: Field,
        selected: bool,
        differs: bool,
    ) {
        let theme = cx.theme;
        let words = self.draft.words(field);
        let style = if differs { theme.strong() } else { theme.normal() };
        let end = match (selected, self.draft.text(field)) {
            (true, Some(line)) => {
                let rest = canvas.width().saturating_sub(x);
                x + line.view(theme, &mut canvas.part(x, y, rest, 1), 0, 0)
            }
            (true, None) => canvas.text(x, y, &format!("‹ {words} ›"), style),
            (false, _) => canvas.text(x, y, &words, style),
        };
        canvas.text(end + 1, y, field.unit(), theme.dim());
        if differs {
            canvas.text_right(canvas.width(), y, t!("◂ changed"), theme.strong());
        }
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
            None if self.field().is_text() => t!("type it   ⏎ apply   Esc close"),
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

    fn select(&mut self, by: isize) -> Result<Option<SettingsAction>, String> {
        self.row = self.row.saturating_add_signed(by);
        Ok(None)
    }

    fn field(&self) -> Field {
        let fields = self.draft.fields();
        fields[self.row.min(fields.len() - 1)]
    }

    /// Another mode has another number of rows.
    fn in_range(mut self) -> Settings {
        self.row = self.row.min(self.draft.fields().len() - 1);
        self
    }
}

/// Columns of a name at least.
const NAME: u16 = 13;

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
