//! Keys are tables: dispatch, footer, help, palette and the check for clashes read the same rows.

use crossterm::event::KeyEvent;

use super::{
    UiAction, ViewContext,
    keys::{Chord, Hint},
};
use crate::plant::role::Role;

/// A key of the page `P`, one row of its table: what is pressed, how it is called, who may, when it is offered, what it does.
pub struct Key<P: 'static> {
    chord: Chord,
    label: &'static str,
    help: &'static str,
    needs: Option<Role>,
    writes: Option<Writes<P>>,
    when: When<P>,
    run: Run<P>,
}

type Writes<P> = fn(&P, &ViewContext) -> Option<Role>;
type When<P> = fn(&P, &ViewContext) -> Offer;

enum Run<P> {
    Act(fn(&mut P, &ViewContext) -> Vec<UiAction>),
    Change(fn(&mut P, &ViewContext)),
    /// A key of every tab: it is only listed here.
    Elsewhere,
}

/// Where a key is offered at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// In the footer and in the help.
    Footer,
    /// In the help: what it acts on is missing, as it says when it is pressed.
    Help,
    /// Nowhere, but it answers when it is pressed.
    Unlisted,
    /// It is no key now.
    Absent,
}

impl Offer {
    /// In the footer only where there is what it acts on.
    pub fn footer_if(there: bool) -> Offer {
        if there { Offer::Footer } else { Offer::Help }
    }
    /// No key at all elsewhere.
    pub fn only_if(there: bool) -> Offer {
        if there { Offer::Footer } else { Offer::Absent }
    }
}

impl<P> Key<P> {
    /// A key that answers what the terminal is to do; an empty label keeps it out of the footer.
    pub const fn new(
        chord: Chord,
        label: &'static str,
        help: &'static str,
        run: fn(&mut P, &ViewContext) -> Vec<UiAction>,
    ) -> Key<P> {
        Key::of(chord, label, help, Run::Act(run))
    }
    /// A key that only changes the page.
    pub const fn change(
        chord: Chord,
        label: &'static str,
        help: &'static str,
        run: fn(&mut P, &ViewContext),
    ) -> Key<P> {
        Key::of(chord, label, help, Run::Change(run))
    }
    /// A key of every tab that is looked for here.
    pub const fn elsewhere(chord: Chord, label: &'static str, help: &'static str) -> Key<P> {
        Key::of(chord, label, help, Run::Elsewhere)
    }
    const fn of(chord: Chord, label: &'static str, help: &'static str, run: Run<P>) -> Key<P> {
        Key { chord, label, help, needs: None, writes: None, when: |_, _| Offer::Footer, run }
    }
    /// The same for users of at least this role.
    pub const fn needs(mut self, role: Role) -> Key<P> {
        self.needs = Some(role);
        self
    }
    /// The same of a key that writes: the least role that may write what it would now, if it would write.
    pub const fn writes(mut self, role: Writes<P>) -> Key<P> {
        self.writes = Some(role);
        self
    }
    /// The same where it is not always offered.
    pub const fn when(mut self, when: When<P>) -> Key<P> {
        self.when = when;
        self
    }

    /// Its row of footer and help; `None` where it is not listed. Where `reads_only`, keys that write are not.
    fn hint(&self, page: &P, cx: &ViewContext, reads_only: bool) -> Option<Hint> {
        let role = self.writes.and_then(|writes| writes(page, cx));
        let label = match (self.when)(page, cx) {
            Offer::Footer => self.label,
            Offer::Help => "",
            Offer::Unlisted | Offer::Absent => return None,
        };
        let hint = Hint::of(self.chord, label, self.help);
        (!reads_only || role.is_none()).then_some(Hint { needs: role.or(self.needs), ..hint })
    }
}

/// The keys of a page at a moment, in the order of the footer.
pub struct Keys<P: 'static>(Vec<Part<P>>);

enum Part<P: 'static> {
    Rows(&'static [Key<P>]),
    Below(&'static Below<P>),
}

/// Keys that are no rows of a table: of a form that is typed into, of a page with a state of its own, of the plant file.
pub struct Below<P> {
    pub hints: fn(&P, &ViewContext) -> Vec<Hint>,
    /// `None` where it is none of them.
    pub press: fn(&mut P, &ViewContext, KeyEvent) -> Option<Vec<UiAction>>,
}

impl<P> Keys<P> {
    pub fn of(tables: &[&'static [Key<P>]]) -> Keys<P> {
        Keys(tables.iter().copied().map(Part::Rows).collect())
    }
    /// Those that are no rows.
    pub fn below(below: &'static Below<P>) -> Keys<P> {
        Keys(vec![Part::Below(below)])
    }
    pub fn and(mut self, others: Keys<P>) -> Keys<P> {
        self.0.extend(others.0);
        self
    }

    /// The rows of footer and help.
    pub fn hints(&self, page: &P, cx: &ViewContext, reads_only: bool) -> Vec<Hint> {
        let hints = |part: &Part<P>| match part {
            Part::Rows(rows) => rows.iter().filter_map(|key| key.hint(page, cx, reads_only)).collect(),
            Part::Below(below) => (below.hints)(page, cx),
        };
        self.0.iter().flat_map(hints).collect()
    }

    /// Does what the key of the table does that was pressed, then `after` where it leaves the terminal nothing to do;
    /// `None` where it is none of them.
    pub fn press(
        &self,
        page: &mut P,
        cx: &ViewContext,
        event: KeyEvent,
        after: fn(&mut P, &ViewContext) -> Vec<UiAction>,
    ) -> Option<Vec<UiAction>> {
        for part in &self.0 {
            let rows = match part {
                Part::Rows(rows) => rows,
                Part::Below(below) => match (below.press)(page, cx, event) {
                    Some(actions) => return Some(actions),
                    None => continue,
                },
            };
            let is_meant = |key: &&Key<P>| key.chord.is(event) && (key.when)(page, cx) != Offer::Absent;
            let actions = match rows.iter().find(is_meant).map(|key| &key.run) {
                Some(Run::Act(run)) => run(page, cx),
                Some(Run::Change(run)) => {
                    run(page, cx);
                    Vec::new()
                }
                Some(Run::Elsewhere) | None => continue,
            };
            return Some(if actions.is_empty() { after(page, cx) } else { actions });
        }
        None
    }

    pub fn has(&self, chord: Chord) -> bool {
        self.rows().any(|key| key.chord == chord)
    }

    /// Their chords, for the test that no key means two things.
    #[cfg(test)]
    pub fn chords(&self) -> Vec<Chord> {
        self.rows().filter(|key| !matches!(key.run, Run::Elsewhere)).map(|key| key.chord).collect()
    }

    fn rows(&self) -> impl Iterator<Item = &'static Key<P>> {
        self.0.iter().flat_map(|part| if let Part::Rows(rows) = part { *rows } else { &[] })
    }
}

/// The rows of a key table that move in a list: `motions!("select", Alarms::select)`.
macro_rules! motions {
    ($label:literal, $move:expr) => {{
        use crossterm::event::KeyCode;
        use $crate::ui::{key_table::Key, keys::code, widgets::list::Motion};
        [
            Key::change(code(KeyCode::Up), "", "a row up", |page, cx| $move(page, cx, Motion::Rows(-1))),
            Key::change(code(KeyCode::Down), $label, "a row down", |page, cx| $move(page, cx, Motion::Rows(1))),
            Key::change(code(KeyCode::PageUp), "", "a page up", |page, cx| $move(page, cx, Motion::Pages(-1))),
            Key::change(code(KeyCode::PageDown), "", "a page down", |page, cx| $move(page, cx, Motion::Pages(1))),
            Key::change(code(KeyCode::Home), "", "first row", |page, cx| $move(page, cx, Motion::First)),
            Key::change(code(KeyCode::End), "", "last row", |page, cx| $move(page, cx, Motion::Last)),
        ]
    }};
}
pub(crate) use motions;

#[cfg(test)]
pub type PageChords = Vec<(&'static str, Vec<Chord>)>;

#[cfg(test)]
mod tests {
    use crossterm::event::{KeyCode, KeyModifiers};

    use super::*;
    use crate::ui::{
        fixture::{Fixture, with_cx},
        global::{self, GlobalKey},
        keys::{char, code},
        replay_keys,
        tabs::{Tab, Tabs},
    };

    fn assert_no_clash(name: &str, chords: Vec<Chord>) {
        let chords_of = |table: &[GlobalKey]| table.iter().map(|key| key.chord()).collect::<Vec<_>>();
        // These mean the same in the past: a time is asked for, a step is made, and Esc leads back.
        let same = [char('@'), char('['), char(']'), code(KeyCode::Esc)];
        let replayed = chords_of(replay_keys::KEYS).into_iter().filter(|chord| !same.contains(chord));
        let all: Vec<Chord> = chords.into_iter().chain(chords_of(&global::keys())).chain(replayed).collect();
        for (n, chord) in all.iter().enumerate() {
            assert!(!all[..n].contains(chord), "{name}: {} means two things", chord.name());
        }
    }

    #[test]
    fn no_key_means_two_things_on_one_tab() {
        assert_no_clash("global", vec![]);
        for (page, chords) in Tab::ALL.iter().flat_map(|tab| Tabs::chords(*tab)) {
            assert_no_clash(page, chords);
        }
    }

    #[test]
    fn a_key_is_listed_and_heard_as_it_is_offered() {
        type Row = Key<u32>;
        const TABLE: &[Row] = &[
            Row::change(char('f'), "footer", "", |pressed, _| *pressed += 1),
            Row::change(char('h'), "help", "", |pressed, _| *pressed += 1).when(|_, _| Offer::Help),
            Row::change(char('u'), "unlisted", "", |pressed, _| *pressed += 1).when(|_, _| Offer::Unlisted),
            Row::change(char('n'), "none", "", |pressed, _| *pressed += 1).when(|_, _| Offer::Absent),
            Row::elsewhere(char('e'), "elsewhere", "").needs(Role::Technician),
            Row::change(char('w'), "writes", "", |pressed, _| *pressed += 1).writes(|_, _| Some(Role::Supervisor)),
        ];
        let (keys, mut pressed) = (Keys::of(&[TABLE]), 0);
        with_cx(&Fixture::normal().snapshot(), |cx| {
            let listed = |reads_only| {
                let hints = keys.hints(&0, cx, reads_only).into_iter();
                hints.map(|hint| (hint.key, hint.label, hint.needs)).collect::<Vec<_>>()
            };
            let row = |key: &str, label: &str, needs| (key.to_owned(), label.to_owned(), needs);
            let read = [row("f", "footer", None), row("h", "", None), row("e", "elsewhere", Some(Role::Technician))];
            assert_eq!(listed(true), read);
            assert_eq!(listed(false), [&read[..], &[row("w", "writes", Some(Role::Supervisor))]].concat());
            for (letter, count) in [('f', 1), ('h', 2), ('u', 3), ('n', 3), ('e', 3), ('w', 4), ('x', 4)] {
                let before = pressed;
                let heard = keys.press(&mut pressed, cx, char(letter).event(), |_, _| vec![UiAction::Leave]);
                assert_eq!((pressed, heard), (count, (before != count).then(|| vec![UiAction::Leave])), "{letter}");
            }
        });
        assert_eq!(keys.chords().len(), 5, "a key of every tab clashes with none of them");
    }

    #[test]
    fn a_split_escape_sequence_is_no_key() {
        let found = |modifiers| global::find(&global::keys(), KeyEvent::new(KeyCode::Char('A'), modifiers));
        assert!(found(KeyModifiers::ALT).is_none());
        assert_eq!(found(KeyModifiers::SHIFT).map(GlobalKey::chord), Some(char('A')));
        assert!(found(KeyModifiers::CONTROL).is_none());
    }
}
