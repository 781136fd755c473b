//! Devices are asked what they are, one request a turn and with the share of live reads: conditions of their profiles want it.

use jiff::Timestamp;

use super::{LinkExit, Task, test::POLLS_BETWEEN};
use crate::{
    bus::{
        diagnostics::{StepResult, identify},
        io::{
            link::{Link, LinkError},
            testing,
        },
        schedule::{Next, Schedule},
    },
    plant::{event::Event, time::elapsed},
};

impl Task<'_> {
    pub(super) fn is_turn_of_identification(&self, next: Next) -> bool {
        let idle = !matches!(next, Next::Run(_));
        let is_due = self.identification_from().is_some_and(|from| from <= self.clock.now());
        is_due && (idle || POLLS_BETWEEN <= self.polls_since_step)
    }

    /// From when on a device may be asked what it is, if one is to be.
    pub(super) fn identification_from(&self) -> Option<Timestamp> {
        self.identification.from().map(|from| from.max(self.live_from()))
    }

    /// One request to the device that is due.
    pub(super) async fn identify(&mut self, link: &mut Link, schedule: &mut Schedule) -> Result<(), LinkExit> {
        let started = self.clock.now();
        let Some((device, unit, next)) = self.identification.due(started) else { return Ok(()) };
        (self.polls_since_step, self.stepped) = (0, false);
        link.last = None;
        let step = identify::objects_from(unit, next);
        let asked = self.requests.unless_stopped(testing::step(link, &step)).await;
        let now = self.clock.now();
        self.live_budget.spent(elapsed(started, now), now);
        let gap = link.request_gap(unit);
        if !gap.is_zero() {
            schedule.keep_gap(device, now + gap);
        }
        let said = match asked {
            // A stop comes first; the request is made again.
            None => {
                link.abandon();
                return Ok(());
            }
            Some(Ok(StepResult::Answer(Ok(answer), _))) => self.identification.on_outcome(device, Ok(&answer), now),
            Some(Ok(StepResult::Answer(Err(fault), _)) | Err(LinkError::Fault(fault))) => {
                self.identification.on_outcome(device, Err(fault), now)
            }
            Some(Ok(StepResult::Bytes(..) | StepResult::Signals(_))) => None,
            Some(Err(LinkError::Gone(why))) => {
                self.identification.hung_up(device, now);
                return Err(LinkExit::Gone(why));
            }
        };
        let Some(objects) = said else { return Ok(()) };
        tracing::debug!(unit, ?objects, "identified");
        self.publish(Event::Identified { at: now, device, objects }).await
    }
}
