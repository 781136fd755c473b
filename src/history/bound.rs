//! What is said of a query that asks for too much: how much that is, what is permitted, and what to ask instead.

use std::time::Duration;

use super::QUERY_TIME_MAX;

/// Of this many rows, behind a period of this many seconds where that can be said.
pub(super) fn too_many_rows(rows: u64, max: u64, asked: Option<u64>) -> String {
    let most = format!("at most {max} rows and, at a station, {} s", QUERY_TIME_MAX.as_secs());
    match asked {
        None => format!("{rows} rows, {most}; choose a shorter period"),
        Some(asked) => {
            let asked = Duration::from_secs(asked);
            let instead = shorter(asked, max, rows)
                .map_or("choose fewer tags".to_owned(), |fits| format!("choose a period of at most {fits}"));
            format!("{rows} rows in {}, {most}; {instead}", about(asked))
        }
    }
}

/// The part of a period that has `max` of its `rows`; `None` if that is less than a second.
fn shorter(period: Duration, max: u64, rows: u64) -> Option<String> {
    let millis = period.as_millis() * u128::from(max) / u128::from(rows.max(1));
    let fits = Duration::from_millis(u64::try_from(millis).unwrap_or(u64::MAX));
    (Duration::from_secs(1) <= fits).then(|| about(fits))
}

/// In whole days, hours, minutes or seconds, and not more than it is.
pub fn about(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 172_800.. => format!("{} days", seconds / 86_400),
        seconds @ 7_200.. => format!("{} hours", seconds / 3_600),
        seconds @ 120.. => format!("{} minutes", seconds / 60),
        seconds => format!("{seconds} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY: u64 = 86_400;

    #[test]
    fn a_refusal_says_bound_query_and_way_out() {
        let refused = |rows, asked| too_many_rows(rows, 100, asked);
        let cases = [
            (
                400,
                Some(40 * DAY),
                "400 rows in 40 days, at most 100 rows and, at a station, 20 s; choose a period of at most 10 days",
            ),
            (101, None, "101 rows, at most 100 rows and, at a station, 20 s; choose a shorter period"),
            // Not `0 minutes`.
            (
                400,
                Some(80),
                "400 rows in 80 s, at most 100 rows and, at a station, 20 s; choose a period of at most 20 s",
            ),
            (400, Some(3), "400 rows in 3 s, at most 100 rows and, at a station, 20 s; choose fewer tags"),
        ];
        for (rows, asked, expect) in cases {
            assert_eq!(refused(rows, asked), expect);
        }
    }

    #[test]
    fn a_time_is_never_more_than_it_is() {
        let cases = [
            (119, "119 s"),
            (179, "2 minutes"),
            (7_199, "119 minutes"),
            (2 * DAY - 1, "47 hours"),
            (3 * DAY - 1, "2 days"),
        ];
        assert_eq!(cases.map(|(seconds, _)| about(Duration::from_secs(seconds))), cases.map(|(_, expect)| expect));
    }
}
