//! The keys of the alarms tab, page by page.

use super::{Alarms, Page, actions, filter};
use crate::{plant::alarm::AlarmState, ui::tabs::prelude::*};

type Key = crate::ui::key_table::Key<Alarms>;

const MOVE: [Key; 6] = motions!("select", Alarms::step);

/// Esc leaves the past once it leads nowhere back here.
const PREVIOUS: [Key; 1] = [Key::elsewhere(code(KeyCode::Esc), "back", "previous page")
    .when(|alarms, cx| Offer::only_if(cx.is_past() && alarms.leads_back()))];

/// Keys of every tab, but here is where they are looked for.
const EVERYWHERE: [Key; 2] = [
    Key::elsewhere(char('a'), "ack", "acknowledge the selected alarm").needs(Role::Technician),
    Key::elsewhere(char('A'), "all", "acknowledge all that are listed (asks first)").needs(Role::Technician),
];

const VIEWS: [Key; 3] = [
    Key::change(char('v'), "view", "next view: active, suppressed, system, journal, metrics, handover", |alarms, _| {
        alarms.turn(1)
    }),
    Key::change(char('V'), "", "previous view", |alarms, _| alarms.turn(-1)),
    Key::new(char('b'), "", "bell for new alarms on or off", |_, cx| actions::toggle_bell(cx)),
];

const RESET: [Key; 1] =
    [Key::new(char('r'), "reset", "reset a latched alarm whose condition has cleared (asks first)", |alarms, cx| {
        alarms.selected(cx).map_or_else(Vec::new, |alarm| actions::reset(cx, alarm))
    })
    .when(|alarms, cx| Offer::footer_if(alarms.selected(cx).is_some_and(|alarm| alarm.state.is_latched())))
    .needs(Role::Technician)];

const ACTIONS: [Key; 11] = [
    Key::new(char('n'), "note", "acknowledge with a note", Alarms::note).needs(Role::Technician),
    Key::new(char('z'), "shelve", "shelve the alarm for a time, with a reason", |alarms, cx| {
        actions::shelve(cx, &alarms.meant(cx))
    })
    .needs(Role::Technician),
    Key::new(char('/'), "filter", "show only alarms with these words; Esc: show all", listing::ask_filter),
    Key::new(char('p'), "page", "acknowledge all on this page of the list (asks first)", |alarms, cx| {
        actions::acknowledge_all(cx, alarms.seen(cx).into_iter(), false)
    })
    .needs(Role::Technician),
    Key::change(
        char(' '),
        "mark",
        "mark several alarms: a, n and z act on all marked ones; Esc: no marks",
        Alarms::mark,
    ),
    Key::change(code(KeyCode::Right), "expand", "show the consequences of a first-out group", |alarms, cx| {
        alarms.fold(cx, false);
    })
    .when(|alarms, cx| Offer::footer_if(alarms.is_folded(cx, true))),
    Key::change(code(KeyCode::Left), "fold", "hide the consequences of a first-out group", |alarms, cx| {
        alarms.fold(cx, true);
    })
    .when(|alarms, cx| Offer::footer_if(alarms.is_folded(cx, false))),
    Key::change(char('s'), "sort", "sort: most urgent first, latest first, by tag", |alarms, _| {
        alarms.sort = alarms.sort.next();
    }),
    Key::new(
        char('o'),
        "out of service",
        "take the alarm out of service until it is returned, with a reason",
        |alarms, cx| alarms.selected(cx).map_or_else(Vec::new, |alarm| actions::out_of_service(cx, alarm.id)),
    )
    .needs(Role::Supervisor),
    Key::change(char('f'), "", "filter: next priority", |alarms, _| alarms.filter.next_priority()),
    Key::change(char('d'), "", "filter: next state", |alarms, _| alarms.filter.next_state()),
];

const AREA: [Key; 1] = [Key::change(char('g'), "area", "filter: next area", |alarms, cx| match alarms.page {
    Page::Journal => alarms.journal.next_area(cx),
    _ => alarms.filter.next_area(cx.def()),
})
.when(|_, cx| Offer::footer_if(!filter::areas(cx.def()).is_empty()))];

const OPEN: [Key; 1] = [Key::new(
    code(KeyCode::Enter),
    "guidance",
    "full guidance; ⏎ again: the faceplate of the alarm source",
    Alarms::open_guidance,
)];

const GO: [Key; 5] = [
    Key::new(char('m'), "", "go to the mimic, with the source of the alarm selected", Alarms::show_on_mimic),
    Key::new(char('t'), "", "go to the trend at the time of the alarm", Alarms::show_trend),
    Key::new(char('c'), "", "go to the controller of the alarm", Alarms::show_controller),
    Key::change(char('j'), "journal", "journal of the alarm source", Alarms::turn_to_journal),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Alarms::why),
];

const BACK: [Key; 1] = [Key::new(char('u'), "return", "unshelve, or return to service", |alarms, cx| {
    alarms.suppressed(cx).map_or_else(Vec::new, |alarm| actions::put_back(cx, &alarm))
})
.when(|alarms, cx| {
    let state = alarms.suppressed(cx).map(|alarm| alarm.state);
    Offer::footer_if(matches!(state, Some(AlarmState::Shelved | AlarmState::OutOfService)))
})
.needs(Role::Technician)];

const SEARCH: [Key; 2] = [
    Key::new(
        char('/'),
        "search",
        "search by words of tag, message, user; and by time: 06:00-14:00",
        Alarms::ask_search,
    ),
    Key::change(char('j'), "list", "back to the list", Alarms::turn_to_journal),
];

const QUIET: [Key; 1] = [Key::change(
    char('d'),
    "by design",
    "show or hide what was not annunciated: suppression by design, events of suppressed alarms",
    |alarms, _| alarms.journal.toggle_quiet(),
)];

const SHIFT: [Key; 3] = [
    Key::change(code(KeyCode::Left), "", "previous shift", |alarms, cx| alarms.shift(cx, -1)),
    Key::change(code(KeyCode::Right), "shift", "next shift", |alarms, cx| alarms.shift(cx, 1)),
    Key::change(char('l'), "now", "present", |alarms, cx| alarms.shift(cx, 0)),
];

const HANDOVER: [Key; 2] = [
    Key::new(char('n'), "hand over", "hand over the plant to the next shift, with a note", |alarms, _| {
        alarms.handover.want();
        actions::hand_over()
    })
    .needs(Role::Technician),
    Key::new(char('o'), "take over", "take over the plant from the previous shift", |alarms, cx| {
        if alarms.handover.is_own(cx) {
            return actions::own_handover();
        }
        alarms.handover.want();
        actions::take_over(cx)
    })
    .needs(Role::Technician),
];

/// The keys of a page, the most wanted ones first: these must not fall off a narrow footer.
pub fn table(page: Page) -> Keys<Alarms> {
    Keys::of(match page {
        Page::Active | Page::System => &[&PREVIOUS, &EVERYWHERE, &RESET, &VIEWS, &OPEN, &ACTIONS, &AREA, &MOVE, &GO],
        Page::Suppressed => &[&PREVIOUS, &BACK, &VIEWS, &OPEN, &MOVE, &GO],
        Page::Journal => &[&PREVIOUS, &SEARCH, &VIEWS, &QUIET, &AREA, &SHIFT, &MOVE],
        Page::Metrics => &[&PREVIOUS, &VIEWS, &SHIFT, &MOVE],
        Page::Handover => &[&PREVIOUS, &HANDOVER, &VIEWS, &SHIFT, &MOVE],
    })
}
