//! One list for every list: the keys that move in it, the selected row, the words of a filter, and the rows on the screen.

use crossterm::event::{KeyCode, KeyEvent};

use crate::{plant::number::to_u16, text::searchable, ui::keys};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// So many rows down.
    Rows(isize),
    /// So many screens down.
    Pages(isize),
    First,
    Last,
}

impl Motion {
    /// The movement of a key in a window.
    pub fn from_key(event: KeyEvent) -> Option<Motion> {
        let motion = match event.code {
            KeyCode::Up => Motion::Rows(-1),
            KeyCode::Down => Motion::Rows(1),
            KeyCode::PageUp => Motion::Pages(-1),
            KeyCode::PageDown => Motion::Pages(1),
            KeyCode::Home => Motion::First,
            KeyCode::End => Motion::Last,
            _ => return None,
        };
        keys::code(event.code).is(event).then_some(motion)
    }

    /// The row that it leads to from row `at` of `count`, where the screen has `room` rows.
    pub fn to(self, at: usize, count: usize, room: usize) -> usize {
        let last = count.saturating_sub(1);
        let by = match self {
            Motion::Rows(by) => by,
            Motion::Pages(by) => by.saturating_mul(room.max(1).cast_signed()),
            Motion::First => return 0,
            Motion::Last => return last,
        };
        at.saturating_add_signed(by).min(last)
    }
}

/// The first row on the screen, so that the selected one is in sight.
pub fn first(selected: usize, count: usize, room: usize) -> usize {
    selected.saturating_sub(room / 2).min(count.saturating_sub(room))
}

/// The rows on the screen: how far down each stands, its number and itself.
pub fn on_screen<T>(rows: &[T], first: usize, room: usize) -> impl Iterator<Item = (u16, usize, &T)> {
    rows.iter().enumerate().skip(first).take(room).enumerate().map(|(y, (n, row))| (to_u16(y), n, row))
}

/// A list without a selection: its keys scroll.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scroll(usize);

impl Scroll {
    /// Moves; the last row stays at the bottom of the screen.
    pub fn on(&mut self, motion: Motion, count: usize, room: usize) {
        self.0 = motion.to(self.first(count, room), count, room);
        self.0 = self.first(count, room);
    }
    /// The first row on the screen.
    pub fn first(self, count: usize, room: usize) -> usize {
        self.0.min(count.saturating_sub(room))
    }
}

/// The selected row of a list whose rows come and go: it stays selected where it goes, and the first is once it is gone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selected<K>(pub Option<K>);

impl<K> Default for Selected<K> {
    fn default() -> Selected<K> {
        Selected(None)
    }
}

impl<K: PartialEq> Selected<K> {
    pub fn place(&self, rows: impl IntoIterator<Item = K>) -> usize {
        rows.into_iter().position(|row| self.0.as_ref() == Some(&row)).unwrap_or(0)
    }
    pub fn on(&mut self, motion: Motion, rows: impl IntoIterator<Item = K>, room: usize) {
        let mut rows: Vec<K> = rows.into_iter().collect();
        let place = rows.iter().position(|row| self.0.as_ref() == Some(row)).unwrap_or(0);
        let place = motion.to(place, rows.len(), room);
        self.0 = (place < rows.len()).then(|| rows.swap_remove(place));
    }
}

/// The words of a filter, in small letters: a text must contain each of them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Words(Vec<String>);

impl Words {
    /// The words of a text; none lets everything through.
    pub fn parse(text: &str) -> Words {
        Words(searchable(text).to_lowercase().split_whitespace().map(str::to_owned).collect())
    }
    /// Does it let everything through?
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    pub fn fit(&self, text: &str) -> bool {
        self.is_empty() || {
            let text = searchable(text).to_lowercase();
            self.0.iter().all(|word| text.contains(word))
        }
    }
}

impl std::fmt::Display for Words {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.0.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_stays_inside_the_list() {
        let check = |motion: Motion, at, expect| assert_eq!(motion.to(at, 20, 5), expect, "{motion:?} from {at}");
        check(Motion::Rows(1), 19, 19);
        check(Motion::Rows(-1), 0, 0);
        check(Motion::Pages(1), 3, 8);
        check(Motion::Pages(-1), 3, 0);
        check(Motion::Last, 0, 19);
        check(Motion::First, 9, 0);
        assert_eq!(Motion::Last.to(0, 0, 5), 0, "an empty list");
    }

    #[test]
    fn the_selected_row_is_always_in_sight() {
        for (selected, expect) in [(0, 0), (2, 0), (5, 3), (19, 15)] {
            assert_eq!(first(selected, 20, 5), expect);
        }
        let mut scroll = Scroll::default();
        scroll.on(Motion::Last, 20, 5);
        assert_eq!(
            (scroll.first(20, 5), scroll.first(6, 5), scroll.first(3, 5)),
            (15, 1, 0),
            "a list may become shorter"
        );
    }

    #[test]
    fn a_selection_follows_its_row() {
        let mut selected = Selected::default();
        selected.on(Motion::Rows(1), ["a", "b", "c"], 5);
        assert_eq!((selected.place(["b", "a"]), selected.place(["x", "y", "b"]), selected.place(["x"])), (0, 2, 0));
    }

    #[test]
    fn every_word_of_a_filter_must_fit() {
        let words = Words::parse(" TIC-1  High ");
        assert!(words.fit("tic-1.PV temperature HIGH") && !words.fit("tic-1 low") && Words::default().fit(""));
        assert_eq!(words.to_string(), "tic-1 high");
    }
}
