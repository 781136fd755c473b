//! The first page: every device in one row, with how it stands and what it controls.

use super::device::{signal_mark, status_text};
use crate::plant::{
    alarm::ActiveAlarm,
    def::{Faceplate, Subject},
};
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

/// All devices of the plant.
#[derive(Debug, Default)]
pub struct Devices;

impl Listing for Devices {
    type Answer = ();
    type Row = DeviceDef;
    type Id = DeviceId;

    const TRENDS: bool = true;
    const NEWEST_FIRST: bool = false;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        Heading::new("", t!("this plant has no devices")).words(summary(cx), cx.theme.normal())
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, DeviceDef>> {
        cx.def().devices.iter().map(Cow::Borrowed).collect()
    }

    fn id(device: &DeviceDef) -> DeviceId {
        device.id
    }

    fn columns(&self, cx: &ViewContext, room: u16) -> Vec<Column<DeviceDef>> {
        let widths = DeviceColumns::new(cx, room);
        let value = DeviceColumns::VALUE;
        vec![
            left(widths.name, t!("device"), |_, device: &DeviceDef| device.name.clone())
                .styled(|cx, _| cx.theme.strong()),
            left(widths.model, t!("model"), |_, device| device.model.clone()),
            left(widths.line, t!("unit"), place),
            fitted(widths.state, t!("state"), |cx, device: &DeviceDef, room| {
                let (mark, words, _) = state(cx, device.id);
                if room < 4 { mark } else { fit(&format!("{mark} {words}"), room) }
            })
            .styled(|cx, device| state(cx, device.id).2),
            left(DeviceColumns::ALARM, t!("alarm"), |cx, device: &DeviceDef| alarm(cx, device.id).0)
                .styled(|cx, device| alarm(cx, device.id).1),
            right(value, "PV", pv_text).styled(|cx, device| style_of(cx, device, pv)).runs_on(),
            right(value, "SV", |cx, device| text_of(cx, device, sv)).styled(|cx, device| style_of(cx, device, sv)),
            right(value, "MV", |cx, device| text_of(cx, device, mv)).styled(|cx, device| style_of(cx, device, mv)),
            left(DeviceColumns::MODE, t!("mode"), mode),
            right(DeviceColumns::REPLY, t!("reply"), reply).dim(),
        ]
    }

    fn searched(&self, _cx: &ViewContext, device: &DeviceDef) -> Option<String> {
        Some(format!("{} {} {} {}", device.name, device.model, device.title, of_plant(&device.title)))
    }

    /// What it is for, and how it stands.
    fn details(&self, cx: &ViewContext, device: &DeviceDef, _: Option<&()>) -> Vec<(String, Style)> {
        let (words, style) = status_text(cx, device.id);
        let title = of_plant(&device.title);
        let gap = if title.is_empty() { "" } else { "  " };
        vec![(format!("{}  {title}{gap}{words}", device.name), style)]
    }

    /// What it controls, if it does.
    fn copied(&self, cx: &ViewContext, device: &DeviceDef, _: Option<&()>) -> Option<String> {
        device.faceplate.as_ref().map(|faceplate| value::line(cx, faceplate.pv))
    }

    /// The curve of what it controls, over the last hour.
    fn trend(&self, cx: &ViewContext, device: &DeviceDef) -> Option<(TagId, (Timestamp, Timestamp))> {
        let pv = device.faceplate.as_ref()?.pv;
        Some((pv, (cx.now.checked_sub(SignedDuration::from_hours(1)).unwrap_or(cx.now), cx.now)))
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

/// `31 devices   2 not responding   1 with alarms`.
fn summary(cx: &ViewContext) -> String {
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
    words
}

/// `L1/1`.
fn place(cx: &ViewContext, device: &DeviceDef) -> String {
    format!("{}/{}", cx.def().line(device.line).name, device.unit)
}

fn pv(faceplate: &Faceplate) -> Option<TagId> {
    Some(faceplate.pv)
}

fn sv(faceplate: &Faceplate) -> Option<TagId> {
    Some(faceplate.sv_to_show())
}

fn mv(faceplate: &Faceplate) -> Option<TagId> {
    faceplate.mv
}

/// PV of a controller; of another device how many values are good.
fn pv_text(cx: &ViewContext, device: &DeviceDef) -> String {
    if device.faceplate.is_some() { text_of(cx, device, pv) } else { values_good(cx, device).0 }
}

fn text_of(cx: &ViewContext, device: &DeviceDef, tag: fn(&Faceplate) -> Option<TagId>) -> String {
    let tag = device.faceplate.as_ref().and_then(tag);
    let Some(shown) = tag.map(|tag| value::show(cx, tag)) else { return String::new() };
    let whole = shown.with_unit();
    if width(&whole) <= DeviceColumns::VALUE { whole } else { shown.bare(DeviceColumns::VALUE) }
}

fn style_of(cx: &ViewContext, device: &DeviceDef, tag: fn(&Faceplate) -> Option<TagId>) -> Style {
    match &device.faceplate {
        Some(faceplate) => tag(faceplate).map_or(cx.theme.dim(), |tag| value::show(cx, tag).style),
        None => values_good(cx, device).1,
    }
}

fn reply(cx: &ViewContext, device: &DeviceDef) -> String {
    let reply = cx.snapshot.device(device.id).response_time.filter(|_| answers(cx, device.id));
    reply.map_or(String::new(), |reply| t!("{reply} ms", reply = reply.as_millis()))
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
