//! The controllers tab: every parameter of a device with unit, range and meaning, and the way to change it.

use crossterm::event::KeyCode;
use ratatui::{Frame, layout::Rect};

use crate::{
    plant::{
        command::Command,
        def::{DeviceDef, DeviceId, LineId, TagId},
        event::LineState,
        ne107::Signal,
        snapshot::{DeviceState, Snapshot},
        tag::{Access, Poll, TagDef},
    },
    ui::{
        Act, Cx,
        chrome::{order_words, outcome_words},
        keys::{Key, char, code},
        modal::{
            Choice, Confirm, Faceplate, Modal, Notice, Settings, Why, entry::range_words, faceplate::device_words,
        },
        widgets::{
            text::{Canvas, age, clock, fit, fit_words, pad, pad_left, whole, width},
            value,
        },
    },
};

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Show the device so many further on.
    Device(isize),
    /// Select so many rows further on.
    Move(isize),
    /// Edit the selected parameter, or look at it if it is read-only.
    Edit,
    /// Say why the selected value is what it is.
    Why,
    /// Read everything now.
    Refresh,
    /// Pick one of the device's actions.
    Actions,
    /// Start or stop auto-tuning.
    Tune,
    /// Run or standby.
    Run,
    /// Close the device's line, or open it again.
    Line,
    /// Look at the communication settings of the device's line, and change them.
    Settings,
}

/// Keys of this tab.
pub const KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Left), label: "", help: "previous device", action: Action::Device(-1) },
    Key { chord: code(KeyCode::Right), label: "device", help: "next device", action: Action::Device(1) },
    Key { chord: code(KeyCode::Up), label: "", help: "select the parameter above", action: Action::Move(-1) },
    Key { chord: code(KeyCode::Down), label: "select", help: "select the parameter below", action: Action::Move(1) },
    Key { chord: code(KeyCode::PageUp), label: "", help: "ten parameters up", action: Action::Move(-10) },
    Key { chord: code(KeyCode::PageDown), label: "", help: "ten parameters down", action: Action::Move(10) },
    Key { chord: code(KeyCode::Home), label: "", help: "first parameter", action: Action::Move(-9_999) },
    Key { chord: code(KeyCode::End), label: "", help: "last parameter", action: Action::Move(9_999) },
    Key {
        chord: code(KeyCode::Enter),
        label: "edit",
        help: "change the parameter, or look at a read-only one",
        action: Action::Edit,
    },
    Key {
        chord: char('w'),
        label: "why",
        help: "why the value is what it is: quality, scaling, bytes",
        action: Action::Why,
    },
    Key { chord: char('u'), label: "refresh", help: "read all parameters of the device now", action: Action::Refresh },
    Key { chord: char('f'), label: "actions", help: "actions of the device (save to memory)", action: Action::Actions },
    Key { chord: char('T'), label: "tune", help: "auto-tuning, if the device has it", action: Action::Tune },
    Key { chord: char('S'), label: "standby", help: "run or standby, if the device has it", action: Action::Run },
    Key {
        chord: char('L'),
        label: "line",
        help: "disconnect the device's line, or connect it again (asks first)",
        action: Action::Line,
    },
    Key {
        chord: char('c'),
        label: "settings",
        help: "communication settings of the device's line: baud rate, parity, timeout …",
        action: Action::Settings,
    },
];

/// State of this tab.
#[derive(Debug)]
pub struct Controllers {
    /// The device that is shown.
    device: DeviceId,
    /// The selected parameter, by its place among the device's tags.
    selected: usize,
}

impl Controllers {
    /// Starts with the first device that has a faceplate.
    pub fn new(snapshot: &Snapshot) -> Controllers {
        let devices = &snapshot.def.devices;
        let first = devices.iter().find(|device| device.faceplate.is_some()).or(devices.first());
        Controllers { device: first.map_or(DeviceId(0), |device| device.id), selected: 0 }
    }

    /// Shows a device.
    pub fn show(&mut self, device: DeviceId) {
        *self = Controllers { device, selected: 0 };
    }

    /// A key of [`KEYS`].
    pub fn on_key(&mut self, cx: &Cx, action: Action) -> Vec<Act> {
        let Some(device) = self.device(cx) else { return Vec::new() };
        let write = |tag: Option<TagId>| tag.and_then(|tag| Modal::write(cx, tag)).map(Act::Open).into_iter().collect();
        match action {
            Action::Device(by) => {
                let count = cx.def().devices.len() as isize;
                let next = (self.device.0 as isize + by).rem_euclid(count);
                self.show(DeviceId(next as u16));
                Vec::new()
            }
            Action::Move(by) => {
                let last = cx.def().tags_of(self.device).count().saturating_sub(1);
                self.selected = self.selected.saturating_add_signed(by).min(last);
                Vec::new()
            }
            Action::Edit => match self.selected(cx) {
                Some(tag) if tag.writable() => write(Some(tag.id)),
                Some(tag) => Faceplate::new(tag.label.clone(), vec![tag.id])
                    .map(|plate| Act::Open(Modal::Faceplate(plate)))
                    .into_iter()
                    .collect(),
                None => Vec::new(),
            },
            Action::Why => {
                let tags = in_groups(cx, self.device).into_iter().map(|tag| tag.id).collect();
                Why::open(Why::new(tags, self.selected))
            }
            Action::Refresh => vec![Act::Order(Command::Refresh(self.device))],
            Action::Actions => {
                let actions = Choice::actions(cx, self.device).map(Modal::Choice);
                let window = actions.map(|list| Notice::unreachable(cx, self.device).map_or(list, Modal::Notice));
                window.map(Act::Open).into_iter().collect()
            }
            Action::Tune => write(device.faceplate.as_ref().and_then(|plate| plate.tune)),
            Action::Run => write(device.faceplate.as_ref().and_then(|plate| plate.run)),
            Action::Settings => vec![Act::Open(Modal::Settings(Box::new(Settings::new(cx, device.line))))],
            Action::Line => vec![Act::Open(Modal::Confirm(connect(cx, device.line)))],
        }
    }

    /// Nothing is due here: all that is shown comes with the snapshot.
    pub fn on_snapshot(&mut self, _cx: &Cx) -> Vec<Act> {
        Vec::new()
    }

    /// Draws it.
    pub fn view(&self, cx: &Cx, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let Some(device) = self.device(cx) else {
            canvas.text(1, 1, "this plant has no devices", cx.theme.normal());
            return;
        };
        self.heading(cx, device, &mut canvas);
        faceplate_row(cx, device, &mut canvas);
        let (width, height) = (canvas.width(), canvas.height());
        let below = self.table(cx, &mut canvas.part(0, 2, width, height.saturating_sub(4)));
        let (end, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
        if let Some(tag) = self.selected(cx) {
            let words = if tag.meaning.is_empty() { &tag.label } else { &tag.meaning };
            let x = canvas.text(1, bottom.saturating_sub(1), &tag.name, cx.theme.strong());
            canvas.text(x + 2, bottom.saturating_sub(1), &fit(words, end.saturating_sub(x + 2)), cx.theme.normal());
        }
        if let Some((words, trouble)) = last_write(cx, self.device) {
            canvas.text(
                1,
                bottom,
                &fit_words(&words, end.saturating_sub(12)),
                if trouble { cx.theme.trouble() } else { cx.theme.dim() },
            );
        }
        if below > 0 {
            canvas.text_right(end, bottom, &format!("{below} more ▼"), cx.theme.normal());
        }
    }

    fn device<'a>(&self, cx: &Cx<'a>) -> Option<&'a DeviceDef> {
        cx.def().devices.get(self.device.index())
    }

    fn selected<'a>(&self, cx: &Cx<'a>) -> Option<&'a TagDef> {
        in_groups(cx, self.device).into_iter().nth(self.selected)
    }

    fn heading(&self, cx: &Cx, device: &DeviceDef, canvas: &mut Canvas) {
        let theme = cx.theme;
        let count = cx.def().devices.len();
        let x = canvas.text(1, 0, &format!("‹ {} ›", device.name), theme.focus());
        let line = &cx.def().line(device.line).name;
        // On a narrow screen whether it answers counts for more than what it is for.
        let status = cx.snapshot.device(device.id);
        let least = if status.diagnosis.is_some() { 100 } else { 80 };
        let title = if canvas.width() < least { String::new() } else { format!("{}  ", device.title) };
        let words = format!("{}  {title}unit {}  {line}", device.model, device.unit);
        let x = canvas.text(x + 2, 0, &words, theme.normal());
        let (mark, style) = match (status.diagnosis, status.state) {
            (Some(reason), _) => (signal_mark(reason.signal()), theme.trouble()),
            (None, DeviceState::Answering) => ("✓".to_owned(), theme.normal()),
            (None, DeviceState::Unknown) => ("?".to_owned(), theme.dim()),
            (None, DeviceState::Failing(_) | DeviceState::Down { .. }) => ("✗".to_owned(), theme.trouble()),
        };
        let words = match status.diagnosis {
            Some(reason) => format!("{}: {reason}", reason.signal().word()),
            None => device_words(cx, device.id),
        };
        let (end, place) = (canvas.width().saturating_sub(1), format!("{}/{count}", self.device.0 + 1));
        let room = end.saturating_sub(x + 2 + width(&place) + 1);
        canvas.text(x + 2, 0, &fit_words(&format!("{mark} {words}"), room), style);
        canvas.text_right(end, 0, &place, theme.dim());
    }

    /// Parameters under the names of their groups, the selected one in sight; returns how many rows are out of sight below.
    fn table(&self, cx: &Cx, canvas: &mut Canvas) -> usize {
        let theme = cx.theme;
        let columns = Columns::of(cx, self.device, canvas.width());
        canvas.text(1, 0, &columns.row(["", "parameter", "value", "", "range", "age", "meaning"]), theme.dim());
        let mut rows: Vec<Option<(usize, &TagDef)>> = Vec::new();
        let mut groups: Vec<(usize, &str)> = Vec::new();
        for (n, tag) in in_groups(cx, self.device).into_iter().enumerate() {
            if groups.last().is_none_or(|(_, group)| *group != tag.group) {
                groups.push((rows.len(), &tag.group));
                rows.push(None);
            }
            rows.push(Some((n, tag)));
        }
        let place = rows.iter().position(|row| row.is_some_and(|(n, _)| n == self.selected)).unwrap_or(0);
        let room = usize::from(canvas.height().saturating_sub(1)).max(1);
        let first = place.saturating_sub(room / 2).min(rows.len().saturating_sub(room));
        for (y, (n, row)) in rows.iter().enumerate().skip(first).take(room).enumerate() {
            let y = y as u16 + 1;
            match row {
                Some((place, tag)) => parameter(cx, canvas, y, &columns, tag, *place == self.selected),
                None => {
                    let group = groups.iter().find(|(row, _)| *row == n).map_or("", |(_, group)| group);
                    canvas.text(1, y, group, theme.strong());
                }
            }
        }
        rows.len().saturating_sub(first + room)
    }
}

/// The letter of NE 107 with a shape of its own.
pub fn signal_mark(signal: Signal) -> String {
    let shape = match signal {
        Signal::Failure => '✗',
        Signal::FunctionCheck => '▼',
        Signal::OutOfSpecification => '?',
        Signal::Maintenance => '◆',
    };
    format!("{shape}{}", signal.letter())
}

/// The tags of a device, those of one group together, in the order of the profile.
fn in_groups<'a>(cx: &Cx<'a>, device: DeviceId) -> Vec<&'a TagDef> {
    let tags: Vec<&TagDef> = cx.def().tags_of(device).collect();
    let mut sorted = tags.clone();
    sorted.sort_by_key(|tag| tags.iter().position(|first| first.group == tag.group));
    sorted
}

/// Closing a line is asked with what it means for everything on it.
fn connect(cx: &Cx, line: LineId) -> Confirm {
    let name = &cx.def().line(line).name;
    if cx.snapshot.line(line).state == LineState::Disconnected {
        return Confirm::order(
            format!("connect {name}"),
            format!("Open line {name} and read its devices again?"),
            Command::Connect(line, true),
        );
    }
    let devices: Vec<&str> =
        cx.def().devices.iter().filter(|device| device.line == line).map(|device| device.name.as_str()).collect();
    let words =
        format!("Close line {name}? {} will be read no more, and their alarms cannot be seen.", devices.join(", "));
    Confirm::order(format!("disconnect {name}"), words, Command::Connect(line, false))
}

fn parameter(cx: &Cx, canvas: &mut Canvas, y: u16, columns: &Columns, tag: &TagDef, selected: bool) {
    let theme = cx.theme;
    let shown = value::show(cx, tag.id);
    let text = shown.bare(Columns::VALUE);
    let old = matches!(tag.poll, Poll::Every(_))
        && cx.age(tag.id).as_secs() < 60
        && cx.snapshot.sample(tag.id).quality.is_good();
    let read = if old || tag.access == Access::Write { String::new() } else { age(cx.age(tag.id)) };
    let range = range_words(cx, tag.id);
    // What is only read needs no range; what can be written says that its range is not known.
    let none = !tag.writable() && tag.labels.is_empty() && cx.snapshot.range(tag.id).is_none();
    let range = if none { "–".to_owned() } else { range };
    let range = range.trim_start_matches("range ").trim_end_matches(&shown.unit).trim_end().to_owned();
    let pen = if tag.writable() { theme.pick("✎", "w") } else { " " };
    let meaning =
        if shown.note.is_empty() || cx.snapshot.sample(tag.id).value.is_some() { &tag.meaning } else { &shown.note };
    let name = format!("{} {}", pad(&tag.short, columns.short), tag.label);
    let row = columns.row([pen, &name, &text, &shown.unit, &whole(&range, Columns::RANGE), &read, meaning]);
    canvas.text(1, y, &row, if selected { theme.focus() } else { theme.normal() });
    if !selected && tag.access != Access::Write && !cx.snapshot.sample(tag.id).quality.is_good() {
        canvas.text(1 + columns.value_at(), y, &pad_left(&text, Columns::VALUE), shown.style);
    }
}

/// `PV 72.4 °C │ SV 70.0 °C │ MV 12.0 % │ PID │ AT off │ RUN`, for devices that have these.
fn faceplate_row(cx: &Cx, device: &DeviceDef, canvas: &mut Canvas) {
    let Some(plate) = &device.faceplate else { return };
    let parts = [
        ("PV", Some(plate.pv)),
        ("SV", Some(plate.sv)),
        ("MV", plate.mv),
        ("", plate.mode),
        ("AT", plate.tune),
        ("", plate.run),
    ];
    let mut x = 1;
    for (name, tag) in parts.into_iter().filter_map(|(name, tag)| Some((name, tag?))) {
        if x > 1 {
            x = canvas.text(x, 1, " │ ", cx.theme.dim());
        }
        if !name.is_empty() {
            x = canvas.text(x, 1, name, cx.theme.dim()) + 1;
        }
        let shown = value::show(cx, tag);
        let room = canvas.width().saturating_sub(x);
        let text = if width(&shown.with_unit()) <= room { shown.with_unit() } else { shown.bare(room) };
        x = canvas.text(x, 1, &text, shown.style);
    }
}

/// The latest write to this device and its outcome, and whether that is a worry.
fn last_write(cx: &Cx, device: DeviceId) -> Option<(String, bool)> {
    let to_device = |tag| cx.def().tag(tag).device == device;
    let order =
        cx.snapshot.orders.iter().find(|order| order.command.written().is_some_and(|(tag, _)| to_device(tag)))?;
    let (words, trouble) = outcome_words(&order.outcome);
    let what = order_words(cx, &order.command, order.old);
    Some((format!("last: {what}  {words} {} by {}", clock(order.at, &cx.def().time_zone), order.by), trouble))
}

/// Widths of the columns that depend on device and screen.
struct Columns {
    short: u16,
    name: u16,
    meaning: u16,
}

impl Columns {
    const VALUE: u16 = 10;
    const UNIT: u16 = 6;
    const RANGE: u16 = 16;
    const AGE: u16 = 6;

    fn of(cx: &Cx, device: DeviceId, width: u16) -> Columns {
        let short = cx.def().tags_of(device).map(|tag| tag.short.chars().count()).max().unwrap_or(0).min(10) as u16;
        let label = cx.def().tags_of(device).map(|tag| tag.label.chars().count()).max().unwrap_or(0) as u16;
        let free = width.saturating_sub(3 + Columns::VALUE + Columns::UNIT + Columns::RANGE + Columns::AGE + 5);
        let name = (short + 1 + label).min(free);
        Columns { short, name, meaning: free.saturating_sub(name) }
    }
    fn value_at(&self) -> u16 {
        2 + self.name + 1
    }
    fn row(&self, [pen, name, value, unit, range, age, meaning]: [&str; 7]) -> String {
        // The line below the table has the selected meaning in full: a stump of it in the table helps nobody.
        let meaning = if self.meaning < 12 { "" } else { meaning };
        format!(
            "{pen:1} {} {} {} {} {} {}",
            pad(name, self.name),
            pad_left(value, Columns::VALUE),
            pad(unit, Columns::UNIT),
            pad(range, Columns::RANGE),
            pad_left(age, Columns::AGE),
            pad(meaning, self.meaning)
        )
    }
}
