//! The first page: every device in one row, with how it stands and what it controls.

use super::device::{signal_mark, status_text};
use crate::plant::{alarm::ActiveAlarm, def::Subject};
use crate::ui::{modal::faceplate::unknown_text, tabs::prelude::*};

/// Widths that depend on the plant and the screen.
struct DeviceColumns {
    name: u16,
    model: u16,
    line: u16,
    state: u16,
}

impl DeviceColumns {
    const VALUE: u16 = 8;
    const MODE: u16 = 8;
    const ALARM: u16 = 6;
    const REPLY: u16 = 6;

    fn new(cx: &ViewContext, screen: u16) -> DeviceColumns {
        let devices = &cx.def().devices;
        let widest = |text: &dyn Fn(&DeviceDef) -> String, least: u16, most: u16| {
            devices.iter().map(|device| width(&text(device))).max().unwrap_or(0).clamp(least, most)
        };
        let name = widest(&|device| device.name.clone(), 6, 10);
        let line = widest(&|device| place(cx, device), 4, 10);
        let fixed =
            3 + DeviceColumns::VALUE * 3 + DeviceColumns::MODE + DeviceColumns::ALARM + DeviceColumns::REPLY + 9;
        let free = screen.saturating_sub(fixed + name + line + 2);
        let model = widest(&|device| device.model.clone(), 5, free.clamp(5, 20));
        // The mark alone, and words where there is room for some.
        let state = match free.saturating_sub(model) {
            room @ 12.. => 3 + room.min(30),
            _ => 2,
        };
        DeviceColumns { name, model, line, state }
    }
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, (devices, selected): (&[&DeviceDef], usize), found: &str) {
    let theme = cx.theme;
    let (end, bottom) = (canvas.width().saturating_sub(1), canvas.height().saturating_sub(1));
    canvas.text(1, 0, &fit_words(&summary(cx, devices.len(), found), end), theme.normal());
    let columns = DeviceColumns::new(cx, canvas.width());
    put(canvas, 1, heading(&columns, theme.dim()));
    let room = usize::from(bottom.saturating_sub(3)).max(1);
    let first = first(selected, devices.len(), room);
    for (y, n, device) in on_screen(devices, first, room) {
        row(cx, canvas, y + 2, &columns, device, n == selected);
    }
    let below = devices.len().saturating_sub(first + room);
    if below > 0 {
        canvas.text_right(end, bottom.saturating_sub(1), &t!("{below} more ▼", below), theme.normal());
    }
    if let Some(device) = devices.get(selected) {
        foot(cx, canvas, device);
    }
}

/// The selected device in the last row: what it is for, and how it stands.
pub fn foot(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef) {
    let (end, bottom) = (canvas.width().saturating_sub(1), canvas.height().saturating_sub(1));
    let x = canvas.text(1, bottom, &device.name, cx.theme.strong());
    let (words, style) = status_text(cx, device.id);
    let title = if device.title.is_empty() { String::new() } else { format!("{}  ", of_plant(&device.title)) };
    let x = canvas.text(x + 2, bottom, &fit_words(&title, end.saturating_sub(x + 4)), cx.theme.normal());
    canvas.text(x, bottom, &fit_words(&words, end.saturating_sub(x)), style);
}

/// `31 devices   2 not responding   1 with alarms`, behind the words of the filter; where it leaves none, that.
pub fn summary(cx: &ViewContext, shown: usize, found: &str) -> String {
    let devices = &cx.def().devices;
    let down = devices.iter().filter(|device| {
        let status = cx.snapshot.device(device.id);
        matches!(status.state, DeviceState::Down { .. } | DeviceState::Unknown)
    });
    let alarmed = devices.iter().filter(|device| alarms(cx, device.id).next().is_some()).count();
    let mut words = match devices.len() {
        1 => t!("1 device").to_owned(),
        n => t!("{n} devices", n),
    };
    for (count, what) in [(down.count(), t!("not responding")), (alarmed, t!("with alarms"))] {
        if count > 0 {
            words.push_str(&format!("   {count} {what}"));
        }
    }
    if shown == 0 && !found.is_empty() {
        words = t!("No matching entries.").to_owned();
    }
    if found.is_empty() { words } else { t!("only \"{filter}\", Esc shows all", filter = found) + "   " + &words }
}

/// The cells of a row from the left: text, width, style. What does not fit as a whole is left out, the last first.
type Cells = Vec<(String, u16, Style)>;

fn put(canvas: &mut Canvas, y: u16, cells: Cells) {
    let mut x = 3;
    for (text, wide, style) in cells {
        if x + wide <= canvas.width() {
            canvas.text(x, y, &fit(&text, wide), style);
        }
        x += wide + 1;
    }
}

fn heading(columns: &DeviceColumns, style: Style) -> Cells {
    let value = |name| (pad_left(name, DeviceColumns::VALUE), DeviceColumns::VALUE, style);
    vec![
        (t!("device").to_owned(), columns.name, style),
        (t!("model").to_owned(), columns.model, style),
        (t!("unit").to_owned(), columns.line, style),
        (if columns.state > 3 { t!("state") } else { "" }.to_owned(), columns.state, style),
        (t!("alarm").to_owned(), DeviceColumns::ALARM, style),
        value("PV"),
        value("SV"),
        value("MV"),
        (t!("mode").to_owned(), DeviceColumns::MODE, style),
        (pad_left(t!("reply"), DeviceColumns::REPLY), DeviceColumns::REPLY, style),
    ]
}

/// `L1/1`.
fn place(cx: &ViewContext, device: &DeviceDef) -> String {
    format!("{}/{}", cx.def().line(device.line).name, device.unit)
}

fn row(cx: &ViewContext, canvas: &mut Canvas, y: u16, columns: &DeviceColumns, device: &DeviceDef, selected: bool) {
    let theme = cx.theme;
    let mut cells = cells(cx, columns, device);
    if selected {
        // A selected row is reversed as a whole; the marks keep their shapes.
        cells.iter_mut().for_each(|(_, _, style)| *style = theme.focus());
        canvas.run(1, y, canvas.width().saturating_sub(2), ' ', theme.focus());
        canvas.text(1, y, theme.pick("▸", ">"), theme.focus());
    }
    put(canvas, y, cells);
}

fn cells(cx: &ViewContext, columns: &DeviceColumns, device: &DeviceDef) -> Cells {
    let theme = cx.theme;
    let (mark, words, style) = state(cx, device.id);
    let mut cells = vec![
        (device.name.clone(), columns.name, theme.strong()),
        (device.model.clone(), columns.model, theme.normal()),
        (place(cx, device), columns.line, theme.normal()),
        (if columns.state > 3 { format!("{mark} {words}") } else { mark }, columns.state, style),
    ];
    let (text, style) = alarm(cx, device.id);
    cells.push((text, DeviceColumns::ALARM, style));
    match &device.faceplate {
        Some(faceplate) => {
            for tag in [Some(faceplate.pv), Some(faceplate.sv_to_show()), faceplate.mv] {
                let shown = tag.map(|tag| value::show(cx, tag));
                let text = shown.as_ref().map_or(String::new(), |shown| {
                    let whole = shown.with_unit();
                    if width(&whole) <= DeviceColumns::VALUE { whole } else { shown.bare(DeviceColumns::VALUE) }
                });
                let style = shown.map_or(theme.dim(), |shown| shown.style);
                cells.push((pad_left(&text, DeviceColumns::VALUE), DeviceColumns::VALUE, style));
            }
            cells.push((mode(cx, device), DeviceColumns::MODE, theme.normal()));
        }
        None => {
            let (words, style) = values_good(cx, device);
            cells.push((words, DeviceColumns::VALUE * 3 + 2, style));
            cells.push((String::new(), DeviceColumns::MODE, style));
        }
    }
    let reply = cx.snapshot.device(device.id).response_time.filter(|_| answers(cx, device.id));
    let reply = reply.map_or(String::new(), |reply| t!("{reply} ms", reply = reply.as_millis()));
    cells.push((pad_left(&reply, DeviceColumns::REPLY), DeviceColumns::REPLY, theme.dim()));
    cells
}

/// `25 of 25 values good`. What is never read by itself says nothing about the device.
pub fn values_good(cx: &ViewContext, device: &DeviceDef) -> (String, Style) {
    let tags = cx.def().tags_of(device.id);
    let tags = tags.filter(|tag| tag.is_read() && tag.calculation.is_none());
    let tags = tags.filter(|tag| tag.is_stored() || !cx.is_past());
    let (good, all) = tags
        .fold((0, 0), |(good, all), tag| (good + usize::from(cx.snapshot.sample(tag.id).quality.is_good()), all + 1));
    let style = if good == all { cx.theme.dim() } else { cx.theme.trouble() };
    (t!("{good} of {all} values good", good, all), style)
}

/// The most urgent alarm of a device, and how many there are.
pub fn alarm(cx: &ViewContext, device: DeviceId) -> (String, Style) {
    let all: Vec<&ActiveAlarm> = alarms(cx, device).collect();
    let Some(alarm) = all.iter().min_by_key(|alarm| cx.def().alarm(alarm.id).priority) else {
        return (String::new(), cx.theme.dim());
    };
    let priority = cx.def().alarm(alarm.id).priority;
    let more = if all.len() > 1 { format!("×{}", all.len()) } else { String::new() };
    let style = cx.theme.alarm(priority, alarm.state, cx.flash());
    (format!("{}{more}", cx.theme.priority_tag(priority)), style)
}

/// AT while it is on, standby, else the control method.
fn mode(cx: &ViewContext, device: &DeviceDef) -> String {
    let Some(faceplate) = &device.faceplate else { return String::new() };
    let on = |tag: Option<_>| tag.is_some_and(|tag| value::is_on(cx, tag) == Some(true));
    if on(faceplate.tune) {
        return t!("AT").to_owned();
    }
    let shown = faceplate.run.filter(|_| on(faceplate.run)).or(faceplate.mode);
    shown.map_or(String::new(), |tag| value::show(cx, tag).bare(DeviceColumns::MODE))
}

fn answers(cx: &ViewContext, device: DeviceId) -> bool {
    matches!(cx.snapshot.device(device).state, DeviceState::Responding | DeviceState::Failing(_))
}

/// The mark of NE 107 and its words; a device that is well has a tick.
pub fn state(cx: &ViewContext, device: DeviceId) -> (String, String, Style) {
    let status = cx.snapshot.device(device);
    match (status.diagnosis, status.state) {
        (Some(reason), _) => (signal_mark(reason.signal()), reason.to_string(), cx.theme.trouble()),
        (None, DeviceState::Responding) => ("✓".to_owned(), t!("good").to_owned(), cx.theme.dim()),
        (None, DeviceState::Unknown) => ("?".to_owned(), unknown_text(cx, device).to_owned(), cx.theme.dim()),
        (None, DeviceState::Failing(n)) => ("✗".to_owned(), t!("failing, {n} in a row", n), cx.theme.trouble()),
        (None, DeviceState::Down { .. }) => ("✗".to_owned(), t!("not responding").to_owned(), cx.theme.trouble()),
    }
}

/// The alarms of a device and of its tags.
pub fn alarms<'a>(cx: &'a ViewContext, device: DeviceId) -> impl Iterator<Item = &'a ActiveAlarm> {
    cx.snapshot.alarms.iter().filter(move |alarm| match cx.def().alarm(alarm.id).subject {
        Subject::Device(of) => of == device,
        Subject::Tag(tag) => cx.def().tag(tag).device == device,
        Subject::Line(_) | Subject::Station => false,
    })
}
