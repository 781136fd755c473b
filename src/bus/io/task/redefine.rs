//! A line that goes on under another definition of the plant file: with its port, and with what it knows of devices that are as they were.

use super::{LinkExit, Task};
use crate::{
    bus::{
        identification::Identification,
        io::{
            link::Link,
            live_reads::LiveReads,
            redefine::{LineDefinition, Redefine},
        },
        plan::{self, Block},
        schedule::Schedule,
    },
    plant::{def::DeviceDef, line_trouble::LineTrouble, redefinition::Renamed},
};

impl Task<'_> {
    /// What was done without a port has ended. Was that for another definition, the line goes on under it.
    pub(super) async fn unless_redefined(
        &mut self,
        ended: Result<(), LinkExit>,
        schedule: &mut Schedule,
    ) -> Result<(), LinkExit> {
        match ended {
            Err(LinkExit::Redefined) => self.redefine(None, schedule).await,
            ended => ended,
        }
    }

    /// Pauses until the plant has another definition, and goes on under it with the port that is open.
    pub(super) async fn redefine(
        &mut self,
        mut link: Option<&mut Link>,
        schedule: &mut Schedule,
    ) -> Result<(), LinkExit> {
        while let Some(link) = link.as_deref_mut().filter(|_| !self.under_way.is_empty()) {
            link.wait_for_answer().await?;
            self.receive_replies(link, schedule).await?;
        }
        self.end_diagnostic(LineTrouble::Reloaded).await?;
        let Some(Redefine { paused, next }) = self.requests.take_redefine() else { return Ok(()) };
        // A reload that was given up meanwhile says so below.
        let _ = paused.send(());
        let next = tokio::select! {
            biased;
            _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
            next = next => next,
        };
        if let Ok(next) = next {
            self.use_definition(next, link, schedule);
        }
        Ok(())
    }

    fn use_definition(&mut self, next: LineDefinition, mut link: Option<&mut Link>, schedule: &mut Schedule) {
        let LineDefinition { def, line, requests, live } = next;
        let renamed = Renamed::new((&self.def, self.line), (&def, line));
        let is_other = |device: &&DeviceDef| device.line == self.line && renamed.device(device.id).is_none();
        for unit in self.def.devices.iter().filter(is_other).map(|device| device.unit) {
            self.unreadable.forget(unit);
            self.in_flight.forget(unit);
            self.refused_all.remove(&unit);
        }
        let rename = |mut block: Block| renamed.rename(&mut block.device, &mut block.tags).then_some(block);
        self.hangups.rename(rename);
        self.recheck.rename(|device| renamed.device(device));
        self.cut = std::mem::take(&mut self.cut).into_iter().filter_map(rename).collect();
        self.requested = self.requested.iter().filter_map(|device| renamed.device(*device)).collect();
        // The plant has ended all writes of before.
        self.unconfirmed.clear();
        self.requests.go_on(&def, line, requests);
        *self.live = LiveReads::new(live);
        self.stats.redefine(&def, line, &renamed);
        schedule.rename(|device| renamed.device(device));
        self.identification = Identification::new(&def, line);
        (self.def, self.line, self.settings.id) = (def, line, line);
        self.bisection.restart();
        let blocks = plan::blocks_with_unpolled(&self.def, self.line, &self.unreadable, &self.requested);
        let now = self.clock.now();
        self.use_plan(link.as_deref_mut(), schedule, blocks, now);
        let kept = renamed.kept_tags();
        let is_new = |block: &Block| block.tags.iter().any(|tag| !kept.contains(tag));
        let new = self.blocks.iter().enumerate().filter(|(_, block)| is_new(block));
        new.for_each(|(index, _)| schedule.due(index, now));
        if let Some(link) = link {
            self.allow_in_flight(link);
        }
        tracing::info!(line = self.settings.name, "goes on under another definition");
    }
}
