//! What the audit log gets of the refusals of requests before the plant: the first of each kind at once, then one entry a minute
//! with their number, so that no flood can fill it; the rest when the station ends.

use std::{mem::discriminant, time::Duration};

use jiff::Timestamp;

use crate::plant::{mqtt_request::MqttRefusal, time::elapsed};

/// Real time between two entries of one kind.
const EVERY: Duration = Duration::from_secs(60);

/// The refusals that are not in the audit log yet. There are as many kinds as [`MqttRefusal`] has.
#[derive(Debug, Default)]
pub struct Refusals {
    kinds: Vec<Kind>,
}

#[derive(Debug)]
struct Kind {
    latest: Refusal,
    /// When one was last handed out.
    recorded: Option<Timestamp>,
}

/// Refusals of one kind, as the audit log gets them.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// What was requested last, as far as it could be read.
    pub what: String,
    /// Why it was refused.
    pub why: MqttRefusal,
    /// How many.
    pub count: u64,
}

impl Refusals {
    /// Counts refusals of one kind.
    pub fn count(&mut self, refusal: Refusal) {
        let kind = discriminant(&refusal.why);
        match self.kinds.iter_mut().find(|known| discriminant(&known.latest.why) == kind) {
            Some(Kind { latest, .. }) => *latest = Refusal { count: latest.count + refusal.count, ..refusal },
            None => self.kinds.push(Kind { latest: refusal, recorded: None }),
        }
    }

    /// What is to be recorded now.
    pub fn take(&mut self, now: Timestamp) -> Vec<Refusal> {
        let is_due = |recorded: Option<Timestamp>| recorded.is_none_or(|recorded| EVERY <= elapsed(recorded, now));
        self.kinds.retain(|kind| kind.latest.count > 0 || !is_due(kind.recorded));
        let due = self.kinds.iter_mut().filter(|kind| kind.latest.count > 0 && is_due(kind.recorded));
        due.map(|kind| {
            kind.recorded = Some(now);
            let taken = kind.latest.clone();
            kind.latest.count = 0;
            taken
        })
        .collect()
    }

    /// All that was counted since the last entry of its kind.
    pub fn take_all(&mut self) -> Vec<Refusal> {
        self.kinds.drain(..).map(|kind| kind.latest).filter(|refusal| 0 < refusal.count).collect()
    }
}

impl Refusal {
    /// What the audit log says became of it.
    pub fn outcome(&self) -> String {
        match self {
            Refusal { why, count: 1, .. } => format!("refused: {why}"),
            Refusal { why, count, .. } => format!("refused: {count} requests, the last: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refuse(refusals: &mut Refusals, what: &str, why: MqttRefusal) {
        refusals.count(Refusal { what: what.into(), why, count: 1 });
    }

    fn recorded(refusals: &mut Refusals, second: i64) -> Vec<String> {
        let now = Timestamp::from_second(second).expect("in range");
        refusals.take(now).iter().map(|refusal| format!("{} {}", refusal.what, refusal.outcome())).collect()
    }

    #[test]
    fn the_first_of_each_kind_is_due_at_once_then_a_count_a_minute() {
        let mut refusals = Refusals::default();
        refuse(&mut refusals, "a", MqttRefusal::Expired);
        assert_eq!(recorded(&mut refusals, 0), ["a refused: it has expired"]);
        for second in 1..1_000 {
            refuse(&mut refusals, &format!("b{second}"), MqttRefusal::Expired);
            refuse(&mut refusals, "?", MqttRefusal::NotARequest(format!("{second}")));
            let found = recorded(&mut refusals, second);
            match second {
                1 => assert_eq!(found, ["? refused: not a request: 1"], "another kind does not wait"),
                60 => assert_eq!(found, ["b60 refused: 60 requests, the last: it has expired"]),
                61 => assert_eq!(found, ["? refused: 60 requests, the last: not a request: 61"]),
                _ => assert!(found.len() <= usize::from(second % 60 < 2), "{second}: {found:?}"),
            }
        }
        let rest: Vec<String> = refusals.take_all().iter().map(Refusal::outcome).collect();
        assert_eq!(
            rest,
            ["refused: 39 requests, the last: it has expired", "refused: 38 requests, the last: not a request: 999"]
        );
        assert!(refusals.take_all().is_empty(), "each is handed out once");
        refuse(&mut refusals, "c", MqttRefusal::Expired);
        assert_eq!(recorded(&mut refusals, 2_000).len(), 1);
        assert!(recorded(&mut refusals, 3_000).is_empty() && refusals.kinds.is_empty(), "and nothing is kept");
    }
}
