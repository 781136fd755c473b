//! The keys of every list, from one place.

use super::Can;
use crate::ui::{key_table::Key, tabs::prelude::*};

/// The keys of a page that is a list: those that move the selection, its own, and what can be done in every list. A key that
/// the page itself has is the page's.
pub fn all<P: KeyTable>(own: Keys<P>) -> Keys<P> {
    let moves = if own.has(code(KeyCode::Down)) { Keys::of(&[]) } else { Keys::of(&[P::MOVING]) };
    moves.and(own).and(Keys::of(&[P::ACTING]))
}

trait Tables: Sized + 'static {
    const MOVING: &'static [Key<Self>];
    const ACTING: &'static [Key<Self>];
}

impl<P: KeyTable> Tables for P {
    const MOVING: &'static [Key<P>] = &motions!("select", step);
    const ACTING: &'static [Key<P>] = &[
        Key::change(char(' '), "mark", "mark several rows, to act on all of them; Esc: no marks", mark)
            .when(|page, cx| offer(page, cx, char(' '), Some(Can::Mark))),
        Key::new(char('t'), "trend", "the curves at its time", trend)
            .when(|page, cx| offer(page, cx, char('t'), Some(Can::Trend))),
        Key::new(char('/'), "filter", "filter the rows while typing; Esc: all rows", filter)
            .when(|page, cx| offer(page, cx, char('/'), None)),
        Key::change(char('s'), "sort", "sort by the next column; after the last: original order", sort)
            .when(|page, cx| offer(page, cx, char('s'), Some(Can::Sort))),
        Key::change(char('S'), "", "sort the other way round", reverse)
            .when(|page, cx| offer(page, cx, char('S'), Some(Can::Sort))),
    ];
}

fn offer<P: KeyTable>(page: &P, cx: &ViewContext, chord: keys::Chord, can: Option<Can>) -> Offer {
    let has = |list: &dyn ListPage| can.is_none_or(|can| list.has(can));
    Offer::only_if(page.list(cx).is_some_and(has) && !page.keys(cx).has(chord))
}

fn step<P: KeyTable>(page: &mut P, cx: &ViewContext, motion: Motion) {
    page.list_mut(cx).into_iter().for_each(|list| list.step(cx, motion));
}

fn mark<P: KeyTable>(page: &mut P, cx: &ViewContext) {
    page.list_mut(cx).into_iter().for_each(|list| list.mark(cx));
}

fn trend<P: KeyTable>(page: &mut P, cx: &ViewContext) -> Vec<UiAction> {
    page.list(cx).and_then(|list| list.trend(cx)).into_iter().collect()
}

/// Opens the line that the words of the filter are typed into.
pub fn filter<P: KeyTable>(page: &mut P, cx: &ViewContext) -> Vec<UiAction> {
    open(page.list(cx).map(|list| Modal::Prompt(Prompt::filter(&list.filter(), list.filter_hint()))))
}

fn sort<P: KeyTable>(page: &mut P, cx: &ViewContext) {
    page.list_mut(cx).into_iter().for_each(|list| list.next_order(cx));
}

fn reverse<P: KeyTable>(page: &mut P, cx: &ViewContext) {
    page.list_mut(cx).into_iter().for_each(|list| list.reverse());
}
