//! What was found of devices on their lines, kept beside the history: it is not searched again at each start.

use std::{
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use tokio::task::JoinHandle;

use crate::{
    bus::io::worker::spawn_blocking,
    plant::{
        PlantDef,
        def::{DeviceDef, DeviceId},
        line_finding::{DeviceFinding, LineFinding},
        snapshot::LineStatus,
    },
    profile::io::{atomic::write_atomic, regular},
};

/// Far more than a plant of the greatest size has.
const BYTES_MAX: u64 = 4 << 20;
const HEAD: &str =
    "# What was found of the devices while they were polled, for the next start. Without it, it is searched again.\n";

/// The file beside a history: `tank.found.toml` beside `tank.duckdb`.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("found.toml")
}

/// What was found, by device.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    #[serde(default)]
    device: Vec<FoundDevice>,
}

/// Its line and unit must still be those of the plant file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FoundDevice {
    name: String,
    line: String,
    unit: u8,
    found: Vec<DeviceFinding>,
}

impl Found {
    /// What stands in the file. One that is damaged costs a search, and is said in the log. Blocks while the disk works.
    pub fn read(path: &Path) -> Found {
        let text = match regular::read_text(path, BYTES_MAX) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Found::default(),
            text => text.map_err(|error| error.to_string()),
        };
        text.and_then(|text| toml::from_str(&text).map_err(|error| error.to_string())).unwrap_or_else(|error| {
            tracing::warn!(path = %path.display(), error, "what was found of devices is searched again");
            Found::default()
        })
    }

    /// Writes it down. Blocks while the disk works.
    fn write(&self, path: &Path) -> Result<(), String> {
        let text = toml::to_string(self).map_err(|error| error.to_string())?;
        write_atomic(path, format!("{HEAD}{text}").as_bytes(), 0o640).map_err(|error| error.to_string())
    }

    /// What holds of the devices of a plant.
    pub fn of(&self, def: &PlantDef) -> Vec<(DeviceId, DeviceFinding)> {
        let place = |found: &FoundDevice| {
            let same = |device: &&DeviceDef| {
                (&*device.name, device.unit) == (&*found.name, found.unit) && *def.line(device.line).name == *found.line
            };
            def.devices.iter().find(same).map(|device| device.id)
        };
        let known = self.device.iter().filter_map(|found| Some((place(found)?, &found.found)));
        known.flat_map(|(device, found)| found.iter().map(move |found| (device, *found))).collect()
    }

    /// As the lines report it now; what was known of a line that has not reported yet stays.
    fn updated(&self, def: &PlantDef, lines: &[LineStatus]) -> Found {
        let earlier = self.of(def);
        let found = |device: DeviceId| -> Vec<DeviceFinding> {
            match lines.get(def.device(device).line.index()).and_then(|line| line.report.as_ref()) {
                Some(report) => report.findings.iter().filter_map(|found| about(*found, device)).collect(),
                None => earlier.iter().filter(|(known, _)| *known == device).map(|(_, found)| *found).collect(),
            }
        };
        let devices = def.devices.iter().map(|device| FoundDevice {
            name: device.name.to_string(),
            line: def.line(device.line).name.to_string(),
            unit: device.unit,
            found: found(device.id),
        });
        Found { device: devices.filter(|device| !device.found.is_empty()).collect() }
    }
}

fn about(found: LineFinding, device: DeviceId) -> Option<DeviceFinding> {
    match found {
        LineFinding::Device(of, found) if of == device => Some(found),
        LineFinding::Device(..) | LineFinding::AnswersPerConnection(_) | LineFinding::DeafAfterConnect(_) => None,
    }
}

/// The file, and what stands in it.
#[derive(Debug, Default)]
pub struct FoundFile {
    path: PathBuf,
    known: Found,
    writing: Option<JoinHandle<()>>,
}

impl FoundFile {
    /// That of a history. Blocks while the disk works.
    pub fn open(history: &Path) -> FoundFile {
        let path = beside(history);
        FoundFile { known: Found::read(&path), path, writing: None }
    }

    /// The same where the disk does not respond: everything is searched again.
    pub fn unread(history: &Path) -> FoundFile {
        FoundFile { path: beside(history), ..FoundFile::default() }
    }

    /// What holds of the devices of a plant.
    pub fn of(&self, def: &PlantDef) -> Vec<(DeviceId, DeviceFinding)> {
        self.known.of(def)
    }

    /// Writes down what the lines report if that is news, beside the caller and one at a time. One that cannot be written is said in
    /// the log: the devices are searched again at the next start.
    pub fn update(&mut self, def: &PlantDef, lines: &[LineStatus]) {
        let found = self.known.updated(def, lines);
        if found == self.known || self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.known = found.clone();
        let path = self.path.clone();
        self.writing = Some(spawn_blocking(move || {
            if let Err(error) = found.write(&path) {
                tracing::warn!(path = %path.display(), error, "what was found of devices is not kept");
            }
        }));
    }

    /// Waits until all is written.
    pub async fn written(self) {
        if let Some(writing) = self.writing {
            // It has said why it failed.
            let _ = writing.await;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::plant::{fixture, line_report::LineReport, tag::Table};

    const HOLE: DeviceFinding = DeviceFinding::Unreadable { table: Table::Holding, address: 100, count: 8 };
    const SIZE: DeviceFinding = DeviceFinding::ReadMost { table: Table::Input, most: 60, refused: 90 };

    fn reporting(def: &PlantDef, findings: Vec<LineFinding>) -> Vec<LineStatus> {
        let report = |line| LineReport { findings: findings.clone(), ..LineReport::new(line) };
        let status = |line| LineStatus { report: Some(Arc::new(report(line))), ..LineStatus::default() };
        def.lines.iter().cloned().map(status).collect()
    }

    #[tokio::test]
    async fn what_is_found_comes_back_for_the_same_device_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let history = folder.path().join("tank.duckdb");
        let mut def = fixture::plant();
        let device = def.devices[0].id;
        let found = [HOLE, SIZE, DeviceFinding::InFlight { most: 2, stated: 16 }];
        let mut file = FoundFile::open(&history);
        assert_eq!(file.of(&def), [], "there is no file");
        let reported = found.iter().map(|found| LineFinding::Device(device, *found));
        file.update(&def, &reporting(&def, reported.chain([LineFinding::AnswersPerConnection(1)]).collect()));
        file.written().await;
        assert_eq!(FoundFile::open(&history).of(&def), found.map(|found| (device, found)));
        let mut file = FoundFile::open(&history);
        file.update(&def, &vec![LineStatus::default(); def.lines.len()]);
        assert_eq!(file.of(&def).len(), 3, "a line that has not reported has nothing to say");
        file.update(&def, &reporting(&def, vec![LineFinding::Device(device, SIZE)]));
        assert_eq!(file.of(&def), [(device, SIZE)], "the rest no longer holds");
        def.devices[0].unit += 1;
        assert_eq!(file.of(&def), [], "another unit is another device");
        file.written().await;
    }

    #[test]
    fn a_damaged_file_costs_a_search_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let history = folder.path().join("tank.duckdb");
        for text in ["[[device]]\nname = 3", "\u{0}", "[[device]]\nname = \"a\"\nwhat = 1"] {
            std::fs::write(beside(&history), text).expect("a file");
            assert_eq!(FoundFile::open(&history).known, Found::default(), "{text}");
        }
    }
}
