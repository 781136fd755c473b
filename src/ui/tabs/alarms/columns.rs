//! The columns of the list of alarms: on a narrow screen what counts most, on a wide one also the last hour of each.

use super::{Alarms, list::AlarmRow};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{alarm::ActiveAlarm, def::Subject},
    ui::{alarm_text::since, layout::Size, modal::reason::subject},
};

/// Columns of priority and state, with the blanks around them.
const MARKS: u16 = 7;
/// Columns of tag and message together: at least, in a wide list at least, and at most.
const TEXT: (u16, u16, u16) = (30, 40, 60);
/// A list of this many columns is wide.
const WIDE: u16 = 90;
/// Columns of a ribbon, at least and at most.
const RIBBON: (u16, u16) = (10, 30);
/// Cells of the bar of the time to respond; the time that is left stands behind it.
const RESPOND: u16 = 6;

/// The width of each column; 0 where there is no room for it.
pub struct AlarmColumns {
    time: u16,
    tag: u16,
    what: u16,
    value: u16,
    ribbon: u16,
    respond: u16,
    state: u16,
    since: u16,
    by: u16,
}

impl AlarmColumns {
    /// For the rows that are seen: those columns that there is room for, the most wanted first.
    pub fn new(rows: &[AlarmRow], cx: &ViewContext, room: usize, width: u16) -> AlarmColumns {
        let wide = Size::Wide <= cx.size;
        let text = if width < WIDE { TEXT.0 } else { TEXT.1 };
        let mut free = width.saturating_sub(MARKS + text);
        let mut take = |columns: u16, wanted: bool| {
            let fits = wanted && columns < free;
            free -= if fits { columns + 1 } else { 0 };
            if fits { columns } else { 0 }
        };
        let (time, value, ribbon) = (take(9, true), take(10, true), take(RIBBON.0, wide));
        let timed = rows.iter().take(room).any(|row| cx.def().alarm(row.alarm.id).guidance.response_time.is_some());
        let respond = take(RESPOND + 9, wide && timed);
        let (state, since, by) = (take(8, true), take(8, true), take(12, wide));
        // What is left is for the text, then for the ribbon.
        let left = (text + free).min(TEXT.2.max(text));
        let more = if ribbon > 0 { (text + free - left).min(RIBBON.1 - ribbon) } else { 0 };
        let seen = rows.iter().take(room).map(|row| self::width(&subject(cx, row.alarm.id)));
        let tag = seen.max().unwrap_or(8).min(left / 2);
        let what = left.saturating_sub(tag + 1);
        // What the messages leave is for values in words.
        let seen = || rows.iter().take(room);
        let message = |row: &AlarmRow| match row.first || row.under || row.folded {
            true => u16::MAX,
            false => self::width(translate(&cx.def().alarm(row.alarm.id).message)),
        };
        let texts = seen().map(message).max().unwrap_or(0).max(8);
        let values = seen().filter_map(|row| Some(self::width(&value_text(cx, row.alarm)?.whole()))).max();
        let moved = what.saturating_sub(texts).min(values.unwrap_or(0).saturating_sub(value));
        let (what, value) = if value > 0 { (what - moved, value + moved) } else { (what, 0) };
        AlarmColumns { time, tag, what, value, ribbon: ribbon + more, respond, state, since, by }
    }

    pub fn headings(&self) -> String {
        let hour = if self.ribbon < 16 { t!("last hour") } else { t!("last 60 minutes") };
        let names = ["", t!("time"), t!("tag"), t!("what"), t!("value"), hour, t!("respond"), t!("state"), t!("for")];
        let [mark, time, tag, what, value, hour, respond, state, since] = names;
        self.row("", [mark, time, tag, what, value, hour, respond, state, since, t!("by")]).concat()
    }

    /// Is the last hour of each alarm shown?
    pub fn has_ribbon(&self) -> bool {
        self.ribbon > 0
    }

    /// The columns before the bars, the bars, and those behind them.
    fn row(&self, priority: &str, cells: [&str; 10]) -> [String; 3] {
        let left = |columns: u16| columns.cast_signed();
        let [mark, time, tag, what, value, ribbon, respond, state, since, by] = cells;
        let widths = [1, left(self.time), left(self.tag), left(self.what), -left(self.value)];
        let before = draw::columns(widths, [mark, time, tag, what, value]);
        let bars = draw::columns([left(self.ribbon), left(self.respond)], [ribbon, respond]);
        let behind = draw::columns([left(self.state), -left(self.since), left(self.by)], [state, since, by]);
        let gap = |text: String| if text.is_empty() { text } else { format!("{text} ") };
        [format!("{}{before} ", pad(priority, 4)), gap(bars), behind]
    }

    /// A row of the list: what stands before the bars, the bars, and what stands behind them.
    pub fn cells(&self, tab: &Alarms, cx: &ViewContext, row: &AlarmRow) -> [String; 3] {
        let alarm: &ActiveAlarm = row.alarm;
        let def = cx.def().alarm(alarm.id);
        let now = value_text(cx, alarm).map_or("–".to_owned(), |shown| shown.within(self.value));
        let left = guidance_text::response(def, alarm, cx.now);
        let respond = left
            .map(|left| format!("{} {}", draw::bar(cx, left.share(), usize::from(RESPOND)), left.short()))
            .unwrap_or_default();
        let cells = [
            cx.theme.state_mark(alarm.state).to_owned(),
            moment(alarm.raised_at, cx.now, &cx.def().time_zone),
            subject(cx, alarm.id),
            what_text(cx, row, self.what),
            now,
            tab.recent.ribbon(cx, alarm, self.ribbon),
            respond,
            translate(alarm.state.word()).to_owned(),
            running(elapsed(since(alarm), cx.now)),
            alarm.acknowledged.as_ref().and_then(|note| note.by.as_deref()).unwrap_or_default().to_owned(),
        ];
        self.row(cx.theme.priority_mark(def.priority), cells.each_ref().map(String::as_str))
    }
}

/// The value that the alarm watches, as it is now.
fn value_text(cx: &ViewContext, alarm: &ActiveAlarm) -> Option<value::Shown> {
    match cx.def().alarm(alarm.id).subject {
        Subject::Tag(tag) => Some(value::show(cx, tag)),
        Subject::Device(_) | Subject::Line(_) | Subject::Station => None,
    }
}

/// `First-out temperature high > 72.0 +14 more, 3 unack`: how many are folded under it, and an acknowledgement that is not on
/// disk, are never cut off.
fn what_text(cx: &ViewContext, row: &AlarmRow, room: u16) -> String {
    let mark = match (row.first, row.under) {
        (true, _) => t!("First-out "),
        (false, true) if row.last => cx.theme.pick("└ ", "` "),
        (false, true) => cx.theme.pick("├ ", "| "),
        (false, false) => "",
    };
    let (long, short) = match (row.folded, row.more, row.more_waiting) {
        (false, ..) => (String::new(), String::new()),
        (true, more, 0) => (t!(" +{more} more", more), format!(" +{more}")),
        (true, more, waiting) => (t!(" +{more} more, {waiting} unack", more, waiting), format!(" +{more} ({waiting})")),
    };
    let unrecorded = row.alarm.acknowledged.as_ref().is_some_and(|note| !note.recorded);
    let unrecorded = if unrecorded { t!(" NOT RECORDED") } else { "" };
    let (long, short) = (long + unrecorded, short + unrecorded);
    let name = format!("{mark}{}", translate(&cx.def().alarm(row.alarm.id).message));
    let text = format!("{name} {}", guidance_text::condition_text(cx, row.alarm.id));
    let text = text.trim_end();
    let choices = [(text, &long), (text, &short), (&name, &short)];
    let whole = choices.iter().find(|(text, more)| width(text) + width(more) <= room);
    match whole {
        Some((text, more)) => format!("{text}{more}"),
        None => format!("{}{short}", fit(text, room.saturating_sub(width(&short)))),
    }
}
