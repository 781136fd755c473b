//! The keys of the trends tab: of its curves, of the list of all values, and where periods lie over each other.

use super::{Asking, RATES, Trends, WINDOWS, overlay, plots::Plot, values::StoredValues, window::Direction};
use crate::ui::tabs::prelude::*;

pub(super) type Key = crate::ui::key_table::Key<Trends>;

pub(super) const CURVES: &[Key] = &[
    Key::elsewhere(code(KeyCode::Esc), "close", "close the picture (any key)")
        .when(|trends, _| Offer::only_if(trends.pictured)),
    Key::new(code(KeyCode::Left), "", "earlier (with the cursor on: cursor to the left)", |trends, cx| {
        trends.side(cx, -1)
    }),
    Key::new(code(KeyCode::Right), "", "later (with the cursor on: cursor to the right)", |trends, cx| {
        trends.side(cx, 1)
    }),
    Key::new(code(KeyCode::PageUp), "", "a whole window earlier", |trends, cx| trends.page(cx, -1)),
    Key::new(code(KeyCode::PageDown), "", "a whole window later", |trends, cx| trends.page(cx, 1)),
    Key::change(code(KeyCode::Up), "", "select the pen above", |trends, cx| trends.select_pen(cx, -1)),
    Key::change(code(KeyCode::Down), "", "select the pen below", |trends, cx| trends.select_pen(cx, 1)),
    Key::change(char('l'), "live", "back to the present", Trends::go_live)
        .when(|_, cx| if cx.is_past() { Offer::Unlisted } else { Offer::Footer }),
    Key::change(char('p'), "pause", "pause, or back to the present", Trends::hold).when(of_present),
    Key::new(char('t'), "time", "go to a time: 03:12, 2026-11-20, or a period", Trends::ask_time)
        .when(of_present_plant),
    Key::change(char('+'), "zoom", "shorter window", |trends, cx| trends.zoom(cx, -1)),
    Key::change(char('='), "", "shorter window", |trends, cx| trends.zoom(cx, -1)),
    Key::change(char('-'), "", "longer window", |trends, cx| trends.zoom(cx, 1)),
    Key::change(char('z'), "", "back to the window before the last zoom, step or jump", |trends, _| {
        trends.revisit(Direction::Back);
    })
    .when(of_present),
    Key::change(char('Z'), "", "forward to the later window again", |trends, _| trends.revisit(Direction::Forward))
        .when(of_present),
    Key::new(char('i'), "picture", "the chart as a picture of the terminal; any key closes it", Trends::show_picture)
        .when(|trends, cx| match of_plant(trends, cx) {
            Offer::Footer => Offer::footer_if(trends.no_picture(cx).is_none()),
            absent => absent,
        }),
    Key::change(char('c'), "cursor", "cursor on or off: reads every pen at one time", |trends, cx| {
        trends.cursor = if trends.cursor.is_some() { None } else { Some(cx.now) };
        trends.between.clear();
    })
    .when(of_present),
    Key::change(
        char('b'),
        "cursor B",
        "cursor B: measures from A to B; again: which one the arrows move",
        Trends::toggle_cursor_b,
    ),
    Key::change(char('n'), "event", "cursor to the next event: alarm, command, note, batch", |trends, cx| {
        trends.go_to_event(cx, 1);
    })
    .when(of_present_plant),
    Key::change(char('N'), "", "cursor to the event before", |trends, cx| trends.go_to_event(cx, -1))
        .when(of_present_plant),
    Key::change(char('g'), "group", "next group of pens", Trends::next_group),
    Key::change(char(' '), "pen", "switch the selected pen on or off", Trends::toggle),
    Key::new(char('s'), "scale", "scale of the selected pen: 0 100, auto, own, own 0 100, plant", Trends::ask_scale)
        .when(of_plant),
    Key::new(char('o'), "overlay", "overlay periods, such as today over yesterday", Trends::ask_overlay).when(of_plant),
    Key::change(char('x'), "plot", "curves, x-y plot, histogram, step response, or large numbers", |trends, _| {
        trends.plot = trends.plot.next();
    }),
    Key::change(char('B'), "", "the pens as large numbers for the wall, or the curves", |trends, _| {
        trends.plot = if trends.plot == Plot::Numbers { Plot::Time } else { Plot::Numbers };
    }),
    Key::change(char('k'), "", "style of the selected pen: steps, lines, dots, bars", Trends::next_stroke),
    Key::change(char('e'), "export", "write the values of the view as CSV", Trends::export_csv)
        .needs(Role::Technician)
        .when(of_plant),
    Key::new(char('E'), "", "write the chart as SVG and PNG", Trends::export_picture)
        .needs(Role::Technician)
        .when(of_plant),
    FIND,
    Key::change(char('v'), "values", "all values with their last hour, or the curves", |trends, _| {
        trends.list_values(true);
    }),
    WHY,
    Key::change(char('m'), "mode", "moving window, or everything since the start of the day", |trends, _| {
        trends.toggle_mode();
    })
    .when(of_present),
    Key::change(char('u'), "rate", "refresh interval of the curves: 0.5, 1, 2, 5, 10 s", |trends, _| {
        trends.rate = (trends.rate + 1) % RATES.len();
    })
    .when(of_present),
    Key::change(code(KeyCode::Enter), "", "zoom to the time between the cursors", Trends::zoom_to_cursors),
];

const FIND: Key =
    Key::new(char('/'), "find", "find values to draw: a filter of the list of all values", Trends::find).when(of_plant);
const WHY: Key = Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Trends::why).when(of_plant);

pub(super) const VALUES: &[Key] = &[
    // In a replay Esc leads back here before it ends the past.
    Key::elsewhere(code(KeyCode::Esc), "back", "previous page").when(|_, cx| Offer::only_if(cx.is_past())),
    Key::change(code(KeyCode::Enter), "curve", "show the curve of the value, or of the marked ones", Trends::open),
    Key::change(char(' '), "mark", "mark the value as a pen, or unmark it", Trends::pick),
    FIND,
    Key::change(char('v'), "curves", "back to the curves", |trends, _| trends.list_values(false)),
    WHY,
];

/// A key of the present: a replay keeps its instant in the view with the cursor on it, and nothing moves.
fn of_present(_: &Trends, cx: &ViewContext) -> Offer {
    Offer::only_if(!cx.is_past())
}

/// A key that needs a plant: its station, or the window of a tab.
fn of_plant(trends: &Trends, _: &ViewContext) -> Offer {
    Offer::only_if(!trends.apart)
}

fn of_present_plant(trends: &Trends, cx: &ViewContext) -> Offer {
    Offer::only_if(!cx.is_past() && !trends.apart)
}

impl KeyTable for Trends {
    fn keys(&self, _cx: &ViewContext) -> Keys<Trends> {
        Keys::of(match (&self.overlay, self.listed) {
            (Some(_), _) => &[overlay::KEYS],
            (None, true) => &[VALUES],
            (None, false) => &[CURVES],
        })
    }

    fn before_key(&mut self) {
        self.export.said = None;
    }

    fn after_key(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.ask(cx)
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        [CURVES, VALUES, overlay::KEYS].map(|keys| ("trends", Keys::of(&[keys]).chords())).to_vec()
    }
}

impl Trends {
    /// A step to the side: of the cursor or the view, in a replay of its instant.
    fn side(&mut self, cx: &ViewContext, by: isize) -> Vec<UiAction> {
        if cx.is_past() {
            return self.replay_by(self.cell(cx), by);
        }
        self.step(cx, by);
        Vec::new()
    }

    /// The same of a whole window.
    fn page(&mut self, cx: &ViewContext, by: isize) -> Vec<UiAction> {
        if cx.is_past() {
            return self.replay_by(SignedDuration::from_secs(WINDOWS[self.window]), by);
        }
        self.pan(cx, 4 * by);
        Vec::new()
    }

    fn select_pen(&mut self, cx: &ViewContext, by: isize) {
        self.selected = Motion::Rows(by).to(self.selected, self.pens(cx).len(), 1);
    }

    fn ask_time(&mut self, _cx: &ViewContext) -> Vec<UiAction> {
        self.asking = Asking::Time;
        open(Modal::Prompt(Prompt::new(t!("Go to a time"), t!("03:12   2026-11-20   2026-11-20 22:00-06:00"), "")))
    }

    pub(super) fn list_values(&mut self, listed: bool) {
        self.listed = listed;
        self.values.rewind();
        self.values.answered.query.want();
    }

    fn why(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let rows = self.values.rows(cx);
        Why::open(match self.listed {
            true => Why::new(rows.iter().map(|row| StoredValues::id(row)).collect(), self.values.place(&rows)),
            false => Why::new(self.pens(cx).into_iter().map(|pen| pen.tag).collect(), self.selected),
        })
    }

    /// Why the chart cannot be drawn as the terminal's own picture.
    fn no_picture(&self, cx: &ViewContext) -> Option<&'static str> {
        match cx.theme.graphics.protocol(cx.preferences.pictures) {
            Ok(_) if self.plot == Plot::Time => None,
            Ok(_) => Some(t!("Only the chart over time is shown as a picture")),
            Err(why) => Some(why.words()),
        }
    }

    /// Has the chart drawn as the terminal's own picture, or says why not.
    fn show_picture(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let why = self.no_picture(cx);
        self.pictured = why.is_none();
        why.map(UiAction::Note).into_iter().collect()
    }
}
