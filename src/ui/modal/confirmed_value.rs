//! The value displayed when a window opened. If it changes before the write, the window asks again.

use crate::t;
use crate::{
    plant::{command::Outcome, def::TagId, exact::Exact},
    ui::{ViewContext, widgets::text::clock},
};

/// A value that changes again and again moves by itself (a program, a tuning): to ask for ever would only be in the way.
const ASKED_MAX: u8 = 2;

/// What was seen of a tag.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfirmedValue {
    tag: TagId,
    value: Option<Exact>,
    /// What stood there before the last change that was noticed, and how often one was.
    before: Option<Exact>,
    asked: u8,
}

impl ConfirmedValue {
    /// The tag as it stands.
    pub fn new(cx: &ViewContext, tag: TagId) -> ConfirmedValue {
        ConfirmedValue { tag, value: cx.snapshot.sample(tag).exact(), before: None, asked: 0 }
    }

    /// Is it another value than was seen? Then that is what was seen from now on, and its author should be asked again.
    pub fn changed(&mut self, cx: &ViewContext) -> bool {
        let now = cx.snapshot.sample(self.tag).good_exact();
        // What has become unknown is not another value: the window shows it, and the station writes over it.
        if now.is_none() || now == self.value || self.asked >= ASKED_MAX {
            return false;
        }
        (self.before, self.value) = (self.value, now);
        self.asked += 1;
        true
    }

    /// The value that a write confirmed now is meant to replace: the one that was shown, also where it is in doubt or gone
    /// by now; the present one where it moves by itself.
    pub fn shown(&self, cx: &ViewContext) -> Option<Exact> {
        let now = cx.snapshot.sample(self.tag).exact();
        if self.asked < ASKED_MAX { self.value.or(now) } else { now.or(self.value) }
    }

    /// The note about a change since the window opened; `None` while the value is unchanged.
    pub fn news(&self, cx: &ViewContext) -> Option<String> {
        let now = cx.snapshot.sample(self.tag).good_exact();
        let other = now.is_some() && now != self.value && self.asked < ASKED_MAX;
        match (other, self.asked) {
            (true, _) => Some(t!("{words}; ⏎ asks again", words = self.words(cx, self.value, now))),
            (false, 0) => None,
            (false, _) => Some(t!("{words}; ⏎ writes all the same", words = self.words(cx, self.before, self.value))),
        }
    }

    /// `changed to 65.0 °C by anna 14:02:31 (was 70.0)`.
    fn words(&self, cx: &ViewContext, before: Option<Exact>, now: Option<Exact>) -> String {
        let text =
            |value: Option<Exact>| value.map_or(t!("unknown").to_owned(), |value| cx.snapshot.format(self.tag, value));
        let unit = cx.snapshot.unit(self.tag);
        let by = cx.snapshot.commands.iter().find(|status| {
            status.outcome == Outcome::Verified
                && status.command.kind.written().is_some_and(|(tag, new)| tag == self.tag && Some(new) == now)
        });
        let by = by.map_or(String::new(), |status| {
            t!(" by {by} {clock}", by = status.by, clock = clock(status.at, &cx.def().time_zone))
        });
        let now = format!("{} {unit}", text(now));
        t!("changed to {trim_end}{by} (was {text})", trim_end = now.trim_end(), by, text = text(before))
    }
}
