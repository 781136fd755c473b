//! Live reads as a pure step machine: which request is next, and what its response shows of the unit.
//!
//! A refused request is halved as a refused poll is ([`RangeBisection`]); later reads go around what was found.

use std::collections::VecDeque;

use jiff::Timestamp;

use super::plan::{AddressRange, RangeBisection, UnreadableRanges, may_be_cut};
use crate::plant::{
    fault::{ExceptionCode, Fault},
    live::{AddressSpan, LivePart, LiveRead, LiveReading},
    number::to_u16,
    tag::Table,
};

/// A table of which this many addresses were refused, and none was read, is asked for no more addresses.
const BARREN: usize = 8;

/// What is lost is asked for so often in a row.
const TRIES_MAX: u8 = 3;

/// What a read has brought of a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// What it holds.
    Word(u16),
    /// The unit does not give it.
    Refused,
    /// The request or its answer was lost, or the unit has no time now: asked again, it may come.
    Lost,
}

impl Outcome {
    /// Of what was read; `None`: nothing came back at all.
    pub fn of(read: Option<Result<u16, Fault>>) -> Outcome {
        match read {
            Some(Ok(word)) => Outcome::Word(word),
            Some(Err(Fault::Exception(code))) if may_be_cut(code) => Outcome::Refused,
            Some(Err(_)) | None => Outcome::Lost,
        }
    }

    /// What it holds, if that was read.
    pub fn word(self) -> Option<u16> {
        if let Outcome::Word(word) = self { Some(word) } else { None }
    }
}

/// How often in a row requests were lost. A unit that has fallen silent is not asked everything several times.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Retries(u8);

impl Retries {
    /// A request has ended: is it to be made again?
    pub fn again(&mut self, is_lost: bool) -> bool {
        self.0 = if is_lost { self.0.saturating_add(1) } else { 0 };
        is_lost && self.0 < TRIES_MAX
    }
}

/// A live read at work.
#[derive(Debug)]
pub struct LiveJob {
    unit: u8,
    queue: VecDeque<AddressSpan>,
    search: RangeBisection,
    reading: LiveReading,
}

impl LiveJob {
    /// Ready for its first request, `at` in UTC and `began` by the line's clock; what is known to be refused is in the
    /// reading already.
    pub fn new(read: &LiveRead, known: &mut UnreadableRanges, at: Timestamp, began: Timestamp) -> LiveJob {
        if read.relearn {
            known.forget(read.unit);
        }
        let unit = read.unit;
        let requests = read.spans.iter().flat_map(|span| known.requests(unit, *span));
        let queue = requests.flat_map(|span| known.refused.cut(unit, span)).collect();
        let refused = Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS));
        let holes = read.spans.iter().flat_map(|span| known.holes_in(unit, *span));
        let parts = holes.map(|span| LivePart { at, span, words: refused.clone() }).collect();
        let reading = LiveReading { began, parts, ..LiveReading::default() };
        LiveJob { unit, queue, search: RangeBisection::default(), reading }
    }

    /// The next request; `None` when it is done.
    pub fn next(&self) -> Option<AddressSpan> {
        self.queue.front().copied()
    }

    /// The request that was next has ended.
    pub fn on_outcome(&mut self, known: &mut UnreadableRanges, at: Timestamp, outcome: Result<Vec<u16>, Fault>) {
        let Some(span) = self.queue.pop_front() else { return };
        self.reading.requests += 1;
        let whole = AddressRange::of_span(self.unit, span);
        match outcome {
            Err(Fault::Exception(code))
                if may_be_cut(code)
                    && 1 < span.count
                    && !self.is_barren(span.table)
                    && !known.refused.holds(self.unit, span) =>
            {
                let half = span.count / 2;
                let second = AddressSpan {
                    address: to_u16(u32::from(span.address) + u32::from(half)),
                    count: span.count - half,
                    ..span
                };
                let parts = [AddressSpan { count: half, ..span }, second];
                let between = AddressRange::of_span(self.unit, AddressSpan { count: 0, ..second });
                let ranges = parts.map(|part| AddressRange::of_span(self.unit, part));
                self.search.refused_range(known, whole, Some((ranges, between)));
                parts.into_iter().rev().for_each(|part| self.queue.push_front(part));
            }
            words => {
                match &words {
                    Ok(_) => {
                        self.search.answered_range(whole);
                        known.refused.given(self.unit, span);
                    }
                    Err(Fault::Exception(code)) if may_be_cut(*code) && span.count == 1 => {
                        self.search.refused_range(known, whole, None);
                    }
                    Err(_) => {}
                }
                // A unit that is silent would cost its timeout for every request.
                let silent = words == Err(Fault::Timeout);
                self.reading.parts.push(LivePart { at, span, words });
                if silent {
                    let rest = self.queue.drain(..).map(|span| LivePart { at, span, words: Err(Fault::Timeout) });
                    self.reading.parts.extend(rest);
                }
            }
        }
        if self.queue.is_empty() {
            self.search.conclude_at_once(known);
            let refused = |part: &&LivePart| matches!(part.words, Err(Fault::Exception(code)) if may_be_cut(code));
            self.reading.parts.iter().filter(refused).for_each(|part| known.refused.add(self.unit, part.span));
        }
    }

    fn is_barren(&self, table: Table) -> bool {
        let mut parts = self.reading.parts.iter().filter(|part| part.span.table == table);
        let refused = |part: &LivePart| matches!(part.words, Err(Fault::Exception(_)));
        parts.clone().all(refused) && BARREN <= parts.by_ref().count()
    }

    /// What was found.
    pub fn finish(self, response_time: Option<std::time::Duration>) -> LiveReading {
        LiveReading { response_time, ..self.reading }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::id::LineId;

    /// A unit that has these holding registers and gives a limited number at once; counts its requests.
    fn serve(known: &mut UnreadableRanges, spans: &[(u16, u16)], has: impl Fn(u16) -> bool, most: u16) -> LiveReading {
        let span =
            |(address, count): &(u16, u16)| AddressSpan { table: Table::Holding, address: *address, count: *count };
        let spans = spans.iter().map(span).collect();
        let read = LiveRead { line: LineId(0), unit: 1, spans, not_before: None, relearn: false };
        let mut job = LiveJob::new(&read, known, Timestamp::UNIX_EPOCH, Timestamp::UNIX_EPOCH);
        while let Some(span) = job.next() {
            let addresses: Vec<u16> = span.range().map(to_u16).collect();
            let outcome = match addresses.iter().all(|address| has(*address)) {
                _ if most < span.count => Err(Fault::Exception(ExceptionCode::ILLEGAL_VALUE)),
                false => Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS)),
                true => Ok(addresses),
            };
            job.on_outcome(known, Timestamp::UNIX_EPOCH, outcome);
        }
        job.finish(None)
    }

    fn values(reading: &LiveReading) -> Vec<u16> {
        let mut all: Vec<u16> = reading.parts.iter().flat_map(|part| part.words.clone().unwrap_or_default()).collect();
        all.sort_unstable();
        all
    }

    #[test]
    fn a_hole_is_found_once_and_read_around() {
        let mut known = UnreadableRanges::default();
        let has = |address: u16| address != 40;
        let first = serve(&mut known, &[(0, 125)], has, 125);
        let expect: Vec<u16> = (0..125).filter(|address| has(*address)).collect();
        assert_eq!(values(&first), expect);
        let second = serve(&mut known, &[(0, 125)], has, 125);
        assert_eq!((values(&second), second.requests), (expect, 2));
        let holes =
            second.parts.iter().filter(|part| part.words == Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS)));
        assert_eq!(holes.map(|part| part.span.address).collect::<Vec<_>>(), [40]);
        known.forget(1);
        assert_eq!(serve(&mut known, &[(0, 125)], |_| true, 125).requests, 1, "what it has now is seen");
    }

    /// A unit that refuses a hole, or too much, with one code for everything.
    fn serve_with(known: &mut UnreadableRanges, code: u8, missing: &[u32], most: u16) -> LiveReading {
        let span = AddressSpan { table: Table::Holding, address: 0, count: 125 };
        let read = LiveRead { line: LineId(0), unit: 1, spans: vec![span], not_before: None, relearn: false };
        let mut job = LiveJob::new(&read, known, Timestamp::UNIX_EPOCH, Timestamp::UNIX_EPOCH);
        while let Some(span) = job.next() {
            let refused = most < span.count || missing.iter().any(|address| span.range().contains(address));
            let words = span.range().map(to_u16).collect();
            let outcome = if refused { Err(Fault::Exception(ExceptionCode(code))) } else { Ok(words) };
            job.on_outcome(known, Timestamp::UNIX_EPOCH, outcome);
        }
        job.finish(None)
    }

    #[test]
    fn whatever_code_a_hole_is_refused_with_it_costs_once() {
        for code in 1..=4 {
            let mut known = UnreadableRanges::default();
            let first = serve_with(&mut known, code, &[40], 125);
            assert_eq!(values(&first).len(), 124, "exception {code}");
            let again = serve_with(&mut known, code, &[40], 125);
            assert_eq!((values(&again).len(), again.requests), (124, 2), "exception {code}");
            assert_eq!(known.most(1, Table::Holding), None, "exception {code} was no limit");
        }
    }

    #[test]
    fn a_limit_and_a_hole_are_distinguished() {
        for code in 1..=4 {
            let mut known = UnreadableRanges::default();
            serve_with(&mut known, code, &[100], 50);
            let again = serve_with(&mut known, code, &[100], 50);
            assert_eq!(values(&again).len(), 124, "exception {code}");
            assert!(again.requests <= 6, "exception {code}: {} requests", again.requests);
        }
    }

    #[test]
    fn a_table_that_a_unit_does_not_have_costs_few_requests() {
        let missing: Vec<u32> = (0..125).collect();
        for code in 1..=4 {
            let mut known = UnreadableRanges::default();
            let reading = serve_with(&mut known, code, &missing, 125);
            assert!(reading.requests < 40, "exception {code}: {} requests", reading.requests);
            assert_eq!(known.of(1).count(), 0, "a unit that refuses everything is not believed");
        }
    }

    #[test]
    fn a_page_that_is_refused_is_searched_once() {
        let mut known = UnreadableRanges::default();
        let has = |address: u16| 500 <= address;
        let first = serve(&mut known, &[(0, 40)], has, 125);
        assert!(9 < first.requests, "is a part of it there?");
        for (n, page) in [[(0, 40)], [(10, 30)]].into_iter().enumerate() {
            let again = serve(&mut known, &page, has, 125);
            assert_eq!((again.requests, values(&again).len()), (1, 0), "read {n}");
        }
        let wider = serve(&mut known, &[(0, 41), (500, 4)], has, 125);
        assert_eq!((wider.requests, values(&wider)), (3, vec![500, 501, 502, 503]));
        let now = serve(&mut known, &[(0, 40)], |_| true, 125);
        assert_eq!((now.requests, values(&now).len()), (1, 40), "it has them now");
        assert!(1 < serve(&mut known, &[(0, 40)], has, 125).requests, "and is searched again when it has not");
        let searched = (0..200).filter(|_| 1 < serve(&mut known, &[(0, 40)], has, 125).requests).count();
        assert_eq!(searched, 3, "now and then");
        serve(&mut known, &[(1_000, 40)], |_| false, 125);
        known.forget(1);
        assert!(1 < serve(&mut known, &[(1_000, 40)], |_| false, 125).requests, "asked for again");
    }

    #[test]
    fn a_unit_that_gives_few_at_once_is_asked_for_few() {
        let mut known = UnreadableRanges::default();
        serve(&mut known, &[(0, 64)], |_| true, 8);
        let again = serve(&mut known, &[(0, 64)], |_| true, 8);
        assert_eq!((values(&again), again.requests), ((0..64).collect(), 8));
    }

    #[test]
    fn a_silent_unit_is_asked_once_a_round() {
        let span = |address| AddressSpan { table: Table::Input, address, count: 10 };
        let spans = vec![span(0), span(100), span(65_526)];
        let read = LiveRead { line: LineId(0), unit: 1, spans, not_before: None, relearn: false };
        let mut known = UnreadableRanges::default();
        let mut job = LiveJob::new(&read, &mut known, Timestamp::UNIX_EPOCH, Timestamp::UNIX_EPOCH);
        job.on_outcome(&mut known, Timestamp::UNIX_EPOCH, Err(Fault::Timeout));
        assert_eq!(job.next(), None);
        let reading = job.finish(None);
        assert_eq!((reading.requests, reading.parts.len()), (1, 3));
        assert!(reading.parts.iter().all(|part| part.words == Err(Fault::Timeout)));
    }
}
