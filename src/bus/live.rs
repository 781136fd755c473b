//! Live reads as a pure step machine: which request is next, and what its response shows of the unit.
//!
//! A unit refuses a whole request when one of its addresses does not exist. The refused span is halved until the address
//! stands alone; later reads go around it. So a hole costs its requests once.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use jiff::Timestamp;

use crate::plant::{
    event::{ExceptionCode, Fault},
    live::{AddressSpan, LivePart, LiveRead, LiveReading},
    number::to_u16,
    tag::Table,
};

/// What the units of a line have refused to live reads.
#[derive(Debug, Clone, Default)]
pub struct KnownHoles {
    holes: BTreeSet<(u8, Table, u32)>,
    /// Most registers or bits that a unit gives at once.
    most: BTreeMap<(u8, Table), u16>,
}

impl KnownHoles {
    /// Everything is asked again.
    pub fn forget(&mut self, unit: u8) {
        self.holes.retain(|(other, ..)| *other != unit);
        self.most.retain(|(other, _), _| *other != unit);
    }

    /// These addresses do not exist.
    pub fn add(&mut self, unit: u8, span: AddressSpan) {
        self.holes.extend(span.range().map(|address| (unit, span.table, address)));
    }

    /// The requests that read a span around its holes.
    fn requests(&self, unit: u8, span: AddressSpan) -> impl Iterator<Item = AddressSpan> {
        let most =
            self.most.get(&(unit, span.table)).copied().unwrap_or(if span.table.is_bits() { 2_000 } else { 125 });
        let range = span.range();
        let holes = self.holes.range((unit, span.table, range.start)..(unit, span.table, range.end));
        let ends: Vec<u32> = holes.map(|(.., hole)| *hole).chain([range.end]).collect();
        let mut from = range.start;
        ends.into_iter().flat_map(move |end| {
            let run = from..end;
            from = end + 1;
            run.step_by(usize::from(most.max(1))).map(move |start| AddressSpan {
                table: span.table,
                address: to_u16(start),
                count: most.min(to_u16(end - start)),
            })
        })
    }

    fn holes_in(&self, unit: u8, span: AddressSpan) -> impl Iterator<Item = AddressSpan> {
        let range = span.range();
        let holes = self.holes.range((unit, span.table, range.start)..(unit, span.table, range.end));
        holes.map(move |(.., hole)| AddressSpan { table: span.table, address: to_u16(*hole), count: 1 })
    }
}

/// A live read at work.
#[derive(Debug)]
pub struct LiveJob {
    unit: u8,
    queue: VecDeque<AddressSpan>,
    reading: LiveReading,
}

impl LiveJob {
    /// Ready for its first request, `at` in UTC and `began` by the line's clock; what is known to be refused is in the
    /// reading already.
    pub fn new(read: &LiveRead, known: &mut KnownHoles, at: Timestamp, began: Timestamp) -> LiveJob {
        if read.relearn {
            known.forget(read.unit);
        }
        let unit = read.unit;
        let queue = read.spans.iter().flat_map(|span| known.requests(unit, *span)).collect();
        let refused = Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS));
        let holes = read.spans.iter().flat_map(|span| known.holes_in(unit, *span));
        let parts = holes.map(|span| LivePart { at, span, words: refused.clone() }).collect();
        LiveJob { unit, queue, reading: LiveReading { began, parts, ..LiveReading::default() } }
    }

    /// The next request; `None` when it is done.
    pub fn next(&self) -> Option<AddressSpan> {
        self.queue.front().copied()
    }

    /// The request that was next has ended.
    pub fn on_outcome(&mut self, known: &mut KnownHoles, at: Timestamp, outcome: Result<Vec<u16>, Fault>) {
        let Some(span) = self.queue.pop_front() else { return };
        self.reading.requests += 1;
        match outcome {
            // 02: it does not have all of them; 03: that is more at once than it gives.
            Err(Fault::Exception(code))
                if matches!(code, ExceptionCode::ILLEGAL_ADDRESS | ExceptionCode::ILLEGAL_VALUE) && 1 < span.count =>
            {
                let half = span.count / 2;
                if code == ExceptionCode::ILLEGAL_VALUE {
                    known.most.insert((self.unit, span.table), half);
                }
                self.queue.push_front(AddressSpan {
                    address: to_u16(u32::from(span.address) + u32::from(half)),
                    count: span.count - half,
                    ..span
                });
                self.queue.push_front(AddressSpan { count: half, ..span });
            }
            words => {
                if words == Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS)) {
                    known.holes.insert((self.unit, span.table, u32::from(span.address)));
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

    /// A unit that has these holding registers and gives so many at once; counts its requests.
    fn serve(known: &mut KnownHoles, spans: &[(u16, u16)], has: impl Fn(u16) -> bool, most: u16) -> LiveReading {
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
        let mut known = KnownHoles::default();
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

    #[test]
    fn a_unit_that_gives_few_at_once_is_asked_for_few() {
        let mut known = KnownHoles::default();
        serve(&mut known, &[(0, 64)], |_| true, 8);
        let again = serve(&mut known, &[(0, 64)], |_| true, 8);
        assert_eq!((values(&again), again.requests), ((0..64).collect(), 8));
    }

    #[test]
    fn a_silent_unit_is_asked_once_a_round() {
        let span = |address| AddressSpan { table: Table::Input, address, count: 10 };
        let spans = vec![span(0), span(100), span(65_526)];
        let read = LiveRead { line: LineId(0), unit: 1, spans, not_before: None, relearn: false };
        let mut known = KnownHoles::default();
        let mut job = LiveJob::new(&read, &mut known, Timestamp::UNIX_EPOCH, Timestamp::UNIX_EPOCH);
        job.on_outcome(&mut known, Timestamp::UNIX_EPOCH, Err(Fault::Timeout));
        assert_eq!(job.next(), None);
        let reading = job.finish(None);
        assert_eq!((reading.requests, reading.parts.len()), (1, 3));
        assert!(reading.parts.iter().all(|part| part.words == Err(Fault::Timeout)));
    }
}
