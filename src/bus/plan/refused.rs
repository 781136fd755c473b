//! Pages of which a unit has refused every part to a live read: they are asked for whole, not part by part again.

use std::collections::BTreeMap;

use crate::plant::{live::AddressSpan, number::to_u16, tag::Table};

/// A page is asked for whole so often; then its parts are looked for again.
const ASKED_MAX: u8 = 60;

/// What was refused throughout. It says nothing of the polls: a unit that starts up refuses everything.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RefusedPages {
    /// End by start, and how often it was asked for since.
    pages: BTreeMap<(u8, Table, u32), (u32, u8)>,
}

impl RefusedPages {
    /// A request was refused of which no part can be read, with those beside it one page.
    pub fn add(&mut self, unit: u8, span: AddressSpan) {
        let (first, (mut start, mut end, mut asked)) = (span.range().start, (span.range().start, span.range().end, 0));
        let touched = self.pages.extract_if(around(unit, span), |_, (end, _)| first <= *end);
        for ((.., old), (old_end, old_asked)) in touched {
            (start, end, asked) = (start.min(old), end.max(old_end), asked.max(old_asked));
        }
        self.pages.insert((unit, span.table, start), (end, asked));
    }

    /// Is every part of a request refused, as far as is known? Counts how often that is said.
    pub fn holds(&mut self, unit: u8, span: AddressSpan) -> bool {
        let mut before = self.pages.range_mut(around(unit, span));
        let page = before
            .next_back()
            .filter(|((.., start), (end, _))| *start <= span.range().start && span.range().end <= *end);
        let Some((key, (_, asked))) = page else { return false };
        *asked += 1;
        let (key, is_old) = (*key, ASKED_MAX < *asked);
        if is_old {
            self.pages.remove(&key);
        }
        !is_old
    }

    /// Something of a request was read: the pages that it touches are none any more.
    pub fn given(&mut self, unit: u8, span: AddressSpan) {
        let (first, last) = (span.range().start, span.range().end);
        self.pages.retain(|(other, table, start), (end, _)| {
            (*other, *table) != (unit, span.table) || last <= *start || *end <= first
        });
    }

    /// A request, cut where a page begins or ends.
    pub fn cut(&self, unit: u8, span: AddressSpan) -> Vec<AddressSpan> {
        let range = span.range();
        let edges = self.pages.range(around(unit, span)).flat_map(|((.., start), (end, _))| [*start, *end]);
        let inner = edges.filter(|edge| range.start < *edge && *edge < range.end);
        let mut edges: Vec<u32> = std::iter::once(range.start).chain(inner).chain([range.end]).collect();
        edges.dedup();
        let part = |edge: &[u32]| AddressSpan { address: to_u16(edge[0]), count: to_u16(edge[1] - edge[0]), ..span };
        edges.windows(2).map(part).collect()
    }

    /// Nothing is known of a unit any more.
    pub fn forget(&mut self, unit: u8) {
        self.pages.retain(|(other, ..), _| *other != unit);
    }
}

/// The pages that begin before the end of a request, or at it.
fn around(unit: u8, span: AddressSpan) -> std::ops::RangeInclusive<(u8, Table, u32)> {
    (unit, span.table, 0)..=(unit, span.table, span.range().end)
}
