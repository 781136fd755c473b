//! A question that is asked again and again: one at a time is on its way, and only its answer counts.

use jiff::{SignedDuration, Timestamp};

/// One kind of question of a tab.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Errand {
    on_way: Option<(u32, Timestamp)>,
    asked: Option<Timestamp>,
    wanted: bool,
}

impl Errand {
    /// Is it time to ask: something changed, or the last question is `every` old? While one is on its way only after
    /// `patience`, so that fast keys never pile up questions before the history.
    pub fn due(&self, now: Timestamp, every: SignedDuration, patience: SignedDuration) -> bool {
        // A clock that was set back must not silence the question for good; a small step back is only the difference
        // between the time of a snapshot and what was guessed before it came.
        let set_back = |at: Timestamp| at.duration_since(now) >= patience;
        match self.on_way {
            Some((_, at)) => now.duration_since(at) >= patience || set_back(at),
            None => self.wanted || self.asked.is_none_or(|at| now.duration_since(at) >= every || set_back(at)),
        }
    }

    /// What is shown has changed: ask as soon as possible.
    pub fn want(&mut self) {
        self.wanted = true;
    }

    /// Question `number` goes out.
    pub fn asked(&mut self, number: u32, now: Timestamp) {
        *self = Errand { on_way: Some((number, now)), asked: Some(now), wanted: false };
    }

    /// An answer has come: when it was asked for, or `None` if it is the answer to an older question.
    pub fn answered(&mut self, number: u32) -> Option<Timestamp> {
        let (_, at) = self.on_way.take_if(|(on_way, _)| *on_way == number)?;
        Some(at)
    }

    /// Has what is shown changed since the last question went out?
    pub fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// How long the question on its way has been waiting.
    pub fn waiting(&self, now: Timestamp) -> Option<SignedDuration> {
        self.on_way.map(|(_, at)| now.duration_since(at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number of seconds")
    }

    fn due(errand: &Errand, second: i64) -> bool {
        errand.due(at(second), SignedDuration::from_secs(2), SignedDuration::from_secs(10))
    }

    #[test]
    fn questions_do_not_pile_up_and_old_answers_do_not_count() {
        let mut errand = Errand::default();
        assert!(due(&errand, 0), "at first");
        errand.asked(1, at(0));
        errand.want();
        assert!(!due(&errand, 5), "while one is on its way");
        assert!(due(&errand, 10), "after a lost answer");
        errand.asked(2, at(10));
        assert_eq!(errand.answered(1), None, "an older answer");
        assert_eq!(errand.answered(2), Some(at(10)));
        assert_eq!(errand.answered(2), None, "twice");
        assert!(!due(&errand, 11) && due(&errand, 12), "at its rate");
        errand.want();
        assert!(due(&errand, 11), "after a change");
        errand.asked(3, at(20));
        assert!(!due(&errand, 19), "guessed time may run a little ahead");
        assert!(due(&errand, 10), "after the clock was set back");
    }
}
