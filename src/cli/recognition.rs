//! What the units of a line are: their SunSpec models, or the device profile whose signature they fit, over a station without
//! history, as `open` does.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use super::{CliError, paths, say, source};
use crate::{
    bus::{
        io::{clock::Clock, transport::Connector},
        live::{Outcome, Retries},
        recognise::{self, Ranked},
        sunspec::Walk,
    },
    history::{Answer, Query},
    plant::{
        PlantDef,
        def::{DeviceDef, DeviceId, LineDef, LineId, Transport},
        fault::Fault,
        line_state::LineState,
        live::{AddressSpan, LiveRead, LiveReading, ReplyTimes},
        tag::Table,
    },
    profile::sunspec::SunSpecDevice,
    station::{self, Session},
};

/// Replies from which the timeout is learned.
const REPLIES: usize = 20;
/// A live read of a line that does not even connect is given up.
const READ_MAX: Duration = Duration::from_secs(30);

/// A station without history over one line of which nothing is known.
pub fn bench_station(line: LineDef, unit: u8) -> station::io::Station {
    let def = Arc::new(bench(line, unit));
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    station::io::start_transient(def, Clock::real(), connectors, Box::new(|_| {}))
}

/// A plant that is one device on one line, of which nothing is known.
fn bench(line: LineDef, unit: u8) -> PlantDef {
    let place = match &line.transport {
        Transport::Serial { port, serial, .. } => format!("{port} {serial}"),
        Transport::Network { host, port, .. } => format!("{host}:{port}"),
    };
    let device = DeviceDef { unit, ..DeviceDef::new(DeviceId(0), "device", LineId(0)) };
    PlantDef { name: "bench".into(), title: place, lines: vec![line], devices: vec![device], ..PlantDef::default() }
}

/// What was found at a unit.
pub struct FoundUnit {
    /// Its address.
    pub unit: u8,
    /// Its first holding register can be read.
    pub has_register: bool,
    /// The device that it is.
    pub kind: FoundKind,
}

/// What a unit is.
pub enum FoundKind {
    /// A device that says itself what it has.
    SunSpec(SunSpecDevice),
    /// It is none, and may be one of these, the likeliest first.
    Other(Vec<Ranked>),
}

/// Asks every unit, and then as long as it takes to learn the timeout of the line.
pub async fn recognise_all(
    line: &LineDef,
    units: &[(u8, bool)],
    known: &[Arc<PlantDef>],
) -> Result<(Vec<FoundUnit>, ReplyTimes), CliError> {
    let station = bench_station(line.clone(), units.first().map_or(1, |(unit, _)| *unit));
    let session = station.session(&paths::operator());
    let (mut found, mut replies) = (Vec::new(), ReplyTimes::default());
    for (unit, has_register) in units.iter().copied() {
        let mut asked = Asked { session: &session, unit, read: BTreeMap::new(), replies: &mut replies };
        let kind = match asked.walk().await? {
            Some(device) => FoundKind::SunSpec(device),
            None => asked.rank(known).await?,
        };
        if let Some(fault) = asked.lost() {
            say(&format!("unit {unit}: not all of its identification could be read: {fault}"));
        }
        found.push(FoundUnit { unit, has_register, kind });
    }
    for (unit, _) in units.iter().cycle().take(2 * REPLIES) {
        if replies.timeout().is_some() {
            break;
        }
        let first = AddressSpan { table: Table::Holding, address: 0, count: 1 };
        Asked { session: &session, unit: *unit, read: BTreeMap::new(), replies: &mut replies }.read(&[first]).await?;
    }
    station.stop().await;
    Ok((found, replies))
}

/// What a unit has said of itself.
pub fn sunspec_words(unit: u8, device: &SunSpecDevice) -> String {
    let [vendor, model, _] = device.identity();
    let more = if device.is_cut { "; not all could be read: there may be more" } else { "" };
    format!("unit {unit}: {vendor} {model}, SunSpec models {}{more}", device.models.len())
}

/// The SunSpec models of a unit; `None` where it has none.
pub async fn sunspec(line: &LineDef, unit: u8) -> Result<Option<SunSpecDevice>, CliError> {
    let station = bench_station(line.clone(), unit);
    let session = station.session(&paths::operator());
    let found = sunspec_at(&session, unit).await;
    station.stop().await;
    found
}

async fn sunspec_at(session: &Session, unit: u8) -> Result<Option<SunSpecDevice>, CliError> {
    connected(session).await?;
    let mut replies = ReplyTimes::default();
    let mut asked = Asked { session, unit, read: BTreeMap::new(), replies: &mut replies };
    match (asked.walk().await?, asked.lost()) {
        (None, Some(fault)) => {
            Err(CliError::Failed(format!("unit {unit}: {fault}; whether it has SunSpec models is not known")))
        }
        (found, _) => Ok(found),
    }
}

/// Waits for the connection; `Err` says why there is none.
async fn connected(session: &Session) -> Result<(), CliError> {
    let mut snapshots = session.snapshots.clone();
    loop {
        match &snapshots.borrow_and_update().line(LineId(0)).state {
            LineState::Waiting { why, .. } => return Err(CliError::Failed(format!("no connection: {why}"))),
            LineState::Connected | LineState::NoTraffic => return Ok(()),
            LineState::Connecting | LineState::Disconnected | LineState::Testing => {}
        }
        snapshots.changed().await.map_err(|_| CliError::StationGone)?;
    }
}

/// A unit that is asked, and what it has said.
struct Asked<'a> {
    session: &'a Session,
    unit: u8,
    read: BTreeMap<(Table, u32), Result<u16, Fault>>,
    replies: &'a mut ReplyTimes,
}

impl Asked<'_> {
    async fn walk(&mut self) -> Result<Option<SunSpecDevice>, CliError> {
        let mut walk = Walk::default();
        while let Some(spans) = walk.next() {
            self.read(&spans).await?;
            walk.on_outcomes(&|table, address| self.outcome(table, address));
        }
        Ok(walk.found().cloned())
    }

    async fn rank(&mut self, known: &[Arc<PlantDef>]) -> Result<FoundKind, CliError> {
        let mut retries = Retries::default();
        for def in known {
            let spans = def.devices.first().map(|device| recognise::spans(def, device)).unwrap_or_default();
            self.read(&spans).await?;
            while retries.again(self.is_lost(&spans)) {
                self.read(&spans).await?;
            }
        }
        Ok(FoundKind::Other(recognise::ranking(known, &|span| self.held(span))))
    }

    /// Good words from an address on, as many as were read.
    fn held(&self, span: AddressSpan) -> Vec<u16> {
        span.range().map_while(|address| self.outcome(span.table, address).word()).collect()
    }

    fn outcome(&self, table: Table, address: u32) -> Outcome {
        Outcome::of(self.read.get(&(table, address)).copied())
    }

    fn is_lost(&self, spans: &[AddressSpan]) -> bool {
        spans.iter().any(|span| span.range().any(|address| self.outcome(span.table, address) == Outcome::Lost))
    }

    /// Why something of it did not come.
    fn lost(&self) -> Option<Fault> {
        let lost = |read: &&Result<u16, Fault>| Outcome::of(Some(**read)) == Outcome::Lost;
        self.read.values().find(lost).and_then(|read| read.err())
    }

    async fn read(&mut self, spans: &[AddressSpan]) -> Result<(), CliError> {
        let read =
            LiveRead { line: LineId(0), unit: self.unit, spans: spans.to_vec(), not_before: None, relearn: false };
        let answer = tokio::time::timeout(READ_MAX, source::query_station(self.session, Query::Registers(read))).await;
        let Ok(answer) = answer else {
            connected(self.session).await?;
            return Err(CliError::Failed(format!("unit {}: the line is not connected any more", self.unit)));
        };
        let Answer::Registers(reading) = answer? else { return Err(source::unexpected()) };
        let LiveReading { response_time, parts, .. } = reading;
        response_time.into_iter().for_each(|time| self.replies.see(time));
        for part in parts {
            for (n, address) in part.span.range().enumerate() {
                let word = part.words.as_ref().map(|words| words.get(n).copied()).map_err(|fault| *fault).transpose();
                self.read.extend(word.map(|word| ((part.span.table, address), word)));
            }
        }
        Ok(())
    }
}
