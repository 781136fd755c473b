//! Orders of a technician for a line itself: other settings, tests.

use std::sync::Arc;

use jiff::Timestamp;

use super::{Effects, Plant};
use crate::plant::{
    command::{BusRequest, Command, Order, OrderId, Outcome, Refusal},
    def::{LineDef, LineId},
    record::{ActionRecord, Record},
};

impl Plant {
    /// Takes an order for a line itself; others are not for this place.
    pub(super) fn line_order(&mut self, order: &Order, at: Timestamp, effects: &mut Effects) -> Option<ActionRecord> {
        match &order.command {
            Command::Configure(settings) => {
                self.remember_settings(settings);
                effects.bus.push((settings.id, BusRequest::Configure(settings.clone())));
            }
            Command::Test(line, tool) => {
                let request = BusRequest::Test { id: order.id, by: order.by.clone(), tool: tool.clone() };
                effects.bus.push((*line, request));
            }
            Command::StopTest(line) => effects.bus.push((*line, BusRequest::StopTest)),
            Command::SaveSettings(line) => {
                effects.save = Some((order.id, self.settings(*line).clone()));
                self.desk.take(order, at);
                return None;
            }
            Command::Write { .. }
            | Command::Acknowledge(_)
            | Command::AcknowledgeAll
            | Command::Refresh(_)
            | Command::Connect(..) => return None,
        }
        self.desk.note(order, Outcome::Verified, &self.board, at)
    }

    /// The plant file was written, or not, with the reason.
    pub fn on_saved(&mut self, order: OrderId, line: LineId, result: Result<(), String>) -> Effects {
        let outcome = match result {
            Ok(()) => {
                self.lines[line.index()].settings_before = None;
                Outcome::Verified
            }
            Err(why) => Outcome::Refused(Refusal::NotSaved(why)),
        };
        let action = self.desk.end(order, outcome, &self.board);
        Effects { records: action.map(Record::Action).into_iter().collect(), ..Effects::default() }
    }

    /// The settings in use.
    fn settings(&self, line: LineId) -> &LineDef {
        self.lines[line.index()].report.as_ref().map_or(self.def.line(line), |report| &report.settings)
    }

    /// Several tries in a row go back to what was there before the first.
    fn remember_settings(&mut self, tried: &LineDef) {
        let in_use = Arc::new(self.settings(tried.id).clone());
        let before = &mut self.lines[tried.id.index()].settings_before;
        *before = Some(before.take().unwrap_or(in_use)).filter(|before| **before != *tried);
    }
}
