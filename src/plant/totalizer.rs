//! Totals of a calculated tag: what its input adds up to while it is known.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    keyword::keyword_enum,
    sample::{Cause, Quality, Sample},
    time::elapsed,
};

keyword_enum! {
    /// What is totalled; the word stands before the parenthesis of `expr`.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Total: "total" {
        /// Its input times hours: kW become kWh, l/h become l.
        Integral => "integral",
        /// Hours in which its input was true.
        OnTime => "on_time",
        /// How often its input became true.
        Starts => "starts",
    }
}

/// A total and what its input was last. It has no value before [`Totalizer::restore`]: one that began again at 0 would look
/// like a reset.
#[derive(Debug, Clone)]
pub struct Totalizer {
    total: Total,
    restored: bool,
    sum: f64,
    /// The input and its time; `None` while it is not known.
    last: Option<(f64, Timestamp)>,
}

impl Totalizer {
    /// At 0.
    pub fn new(total: Total) -> Totalizer {
        Totalizer { total, restored: false, sum: 0.0, last: None }
    }

    /// Goes on from what was stored; what has been added since the start stays.
    pub fn restore(&mut self, stored: f64) {
        if !std::mem::replace(&mut self.restored, true) {
            self.sum += stored;
        }
    }

    /// Goes on from another total, with an input of its own.
    pub fn go_on_from(&mut self, before: &Totalizer) {
        (self.restored, self.sum) = (before.restored, before.sum);
    }

    /// The total with the next sample of its input. An input holds until the next one that has a value, however uncertain;
    /// the time before and while it is bad is not counted, and the total is uncertain as long.
    pub fn add(&mut self, input: Sample) -> Sample {
        if let (Some(value), Some((before, at))) = (input.value, self.last) {
            let hours = elapsed(at, input.at).as_secs_f64() / 3_600.0;
            self.sum += match self.total {
                Total::Integral => before * hours,
                Total::OnTime if before != 0.0 => hours,
                Total::OnTime => 0.0,
                Total::Starts => f64::from(u8::from(before == 0.0 && value != 0.0)),
            };
        }
        self.last = input.value.map(|value| (value, input.at));
        let good = Sample::good(self.sum, input.at);
        match (self.restored, input.quality) {
            (false, _) => Sample::bad(Cause::NotRead, input.at),
            (true, Quality::Good) => good,
            (true, Quality::Uncertain(cause) | Quality::Bad(cause)) => good.uncertain(cause),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn good(second: i64, value: f64) -> Sample {
        Sample::good(value, at(second))
    }

    fn restored(total: Total, stored: f64) -> Totalizer {
        let mut totalizer = Totalizer::new(total);
        totalizer.restore(stored);
        totalizer
    }

    #[test]
    fn an_input_holds_until_the_next_and_bad_time_is_not_counted() {
        let inputs = [
            good(0, 2.0),
            good(1_800, 4.0),
            // One answer is late: the value before it holds until the next.
            good(1_800, 4.0).uncertain(Cause::Timeout),
            good(3_600, 0.0),
            good(5_400, 8.0),
            Sample::bad(Cause::DeviceDown, at(7_200)),
            good(9_000, 8.0),
            good(12_600, 8.0),
        ];
        for (total, expect) in [
            (Total::Integral, [0.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0, 11.0]),
            (Total::OnTime, [0.0, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0, 2.0]),
            (Total::Starts, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
        ] {
            let mut totalizer = restored(total, 0.0);
            for (input, expect) in inputs.into_iter().zip(expect) {
                let found = totalizer.add(input);
                assert_eq!((found.value, found.at), (Some(expect), input.at), "{total:?} with {input:?}");
                let cause = found.quality.cause();
                assert_eq!(cause, input.quality.cause(), "as sure as its input");
                assert!(!found.quality.is_bad());
            }
        }
    }

    #[test]
    fn a_total_goes_on_from_what_was_restored() {
        let mut totalizer = Totalizer::new(Total::OnTime);
        totalizer.add(good(0, 1.0));
        assert_eq!(totalizer.add(good(3_600, 1.0)), Sample::bad(Cause::NotRead, at(3_600)));
        totalizer.restore(100.0);
        totalizer.restore(100.0);
        assert_eq!(totalizer.add(good(3_600, 1.0)), good(3_600, 101.0), "once, and the first hour counts");
    }

    #[test]
    fn time_that_runs_back_takes_nothing_away() {
        let mut totalizer = restored(Total::Integral, 5.0);
        totalizer.add(good(100, 9.0));
        assert_eq!(totalizer.add(good(50, 9.0)), good(50, 5.0));
    }
}
