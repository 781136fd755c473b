//! The keys of every list, from one place.

use crate::ui::{keys::Key, tabs::prelude::*};

/// The keys that move the selection, before those of the page.
pub fn choosing<P: KeyTable>() -> &'static [Key<P>] {
    <P as Tables>::CHOOSING
}

/// What can be done in every list, behind the keys of the page.
pub fn acting<P: KeyTable>() -> &'static [Key<P>] {
    <P as Tables>::ACTING
}

/// The tables of a page.
trait Tables: Sized + 'static {
    const CHOOSING: &'static [Key<Self>];
    const ACTING: &'static [Key<Self>];
}

impl<P: KeyTable> Tables for P {
    const CHOOSING: &'static [Key<P>] = &motions!("select", step);
    const ACTING: &'static [Key<P>] = &[
        Key::change(
            char(' '),
            "mark",
            "mark several rows, for what is done with all of them; Esc: no marks",
            |page: &mut P, cx| {
                page.list_mut().into_iter().for_each(|list| list.mark(cx));
            },
        )
        .when(|page: &P, cx| only_if(page, cx, char(' '), page.list().is_some_and(|list| list.has_marks()))),
        Key::new(char('t'), "trend", "the curves of its time", |page: &mut P, cx| {
            page.list().and_then(|list| list.trend(cx)).into_iter().collect()
        })
        .when(|page: &P, cx| only_if(page, cx, char('t'), page.list().is_some_and(|list| list.trend(cx).is_some()))),
        Key::new(
            char('/'),
            "filter",
            "show only rows with some words, while they are typed; Esc: all rows",
            |page: &mut P, _| open(page.list().map(|list| Modal::Prompt(Prompt::filter(&list.filter())))),
        )
        .when(|page: &P, cx| only_if(page, cx, char('/'), true)),
        Key::change(char('s'), "sort", "sort: by the next column, then as at first", |page: &mut P, cx| {
            page.list_mut().into_iter().for_each(|list| list.next_order(cx));
        })
        .when(|page: &P, cx| only_if(page, cx, char('s'), true)),
        Key::change(char('S'), "", "sort the other way round", |page: &mut P, _| {
            page.list_mut().into_iter().for_each(|list| list.reverse());
        })
        .when(|page: &P, cx| only_if(page, cx, char('S'), true)),
    ];
}

fn step<P: KeyTable>(page: &mut P, cx: &ViewContext, motion: Motion) {
    page.list_mut().into_iter().for_each(|list| list.step(cx, motion));
}

/// A key that the page itself has is the page's; the others are in the footer while there are rows.
fn only_if<P: KeyTable>(page: &P, cx: &ViewContext, chord: keys::Chord, there: bool) -> Offer {
    match there && !page.keys(cx).has(chord) {
        true => Offer::footer_if(page.list().is_some_and(|list| !list.is_empty(cx))),
        false => Offer::Absent,
    }
}
