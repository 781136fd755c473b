//! The value that an operator saw when a window opened: should somebody else change it meanwhile, he is asked again.

use crate::{
    plant::{command::Outcome, def::TagId},
    ui::{Cx, widgets::value},
};

/// A value that changes again and again moves by itself (a program, a tuning): to ask for ever would only be in the way.
const ASKED_MAX: u8 = 2;

/// What was seen of a tag.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    tag: TagId,
    value: Option<f64>,
    /// What stood there before the last change that was noticed, and how often one was.
    before: Option<f64>,
    asked: u8,
}

impl Seen {
    /// The tag as it stands.
    pub fn new(cx: &Cx, tag: TagId) -> Seen {
        Seen { tag, value: cx.snapshot.sample(tag).trusted(), before: None, asked: 0 }
    }

    /// Is it another value than was seen? Then that is what was seen from now on, and its author should be asked again.
    pub fn changed(&mut self, cx: &Cx) -> bool {
        let now = cx.snapshot.sample(self.tag).trusted();
        // What has become unknown is not another value: the window shows it, and the station checks.
        if now.is_none() || now == self.value || self.asked >= ASKED_MAX {
            return false;
        }
        (self.before, self.value) = (self.value, now);
        self.asked += 1;
        true
    }

    /// Has a change been noticed?
    pub fn has_asked(&self) -> bool {
        self.asked > 0
    }

    /// `changed meanwhile from 240 to 300 s by anna; ⏎ writes all the same`.
    pub fn words(&self, cx: &Cx) -> String {
        let before = self.before.map_or("unknown".to_owned(), |before| cx.snapshot.format(self.tag, before));
        let now = value::show(cx, self.tag).with_unit();
        let by = cx.snapshot.orders.iter().find(|order| {
            order.outcome == Outcome::Verified
                && order.command.written().is_some_and(|(tag, new)| tag == self.tag && Some(new) == self.value)
        });
        let by = by.map_or(String::new(), |order| format!(" by {}", order.by));
        format!("changed meanwhile from {before} to {now}{by}; ⏎ writes all the same")
    }
}
