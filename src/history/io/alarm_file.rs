//! The alarm-state file beside a history: appended to and synced before an acknowledgement is confirmed, rewritten
//! when it has grown.

use std::{
    fs::{self, File},
    io::{self, Read, Write},
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use crate::{
    history::alarm_state::{HEADER, LatestEvents, is_cut, line, parse},
    plant::record::AlarmRecord,
    profile::io::{atomic, regular},
};

/// Largest file that is read: many times what a station writes.
const BYTES_MAX: u64 = 64 << 20;
/// The file is rewritten when it has this many lines more than twice those that count.
const SPARE_LINES: usize = 1_000;

/// The file beside a history: `tank.alarms.state` beside `tank.duckdb`.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("alarms.state")
}

/// What was found when it was opened.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RestoredAlarms {
    /// The events to restore, oldest first; `None` where the file does not say: the journal of the history is used
    /// then.
    pub events: Option<Vec<AlarmRecord>>,
    /// What is wrong with it, in words for the operator.
    pub trouble: Option<String>,
}

/// The events that a station has left in its file, to look at; none where there is no file.
pub fn left(path: &Path) -> Result<Vec<AlarmRecord>, String> {
    let bytes = match read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        bytes => bytes.map_err(|error| format!("{} cannot be read: {error}", path.display()))?,
    };
    let events = parse_whole(&bytes).map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(events.iter().cloned().collect())
}

/// The state of the alarms, in memory and on disk.
#[derive(Debug)]
pub struct AlarmFile {
    path: PathBuf,
    events: LatestEvents,
    /// Steps that the file does not hold yet; gone after a failure, when the whole file is due.
    unwritten: Vec<AlarmRecord>,
    file: Option<OpenFile>,
}

/// The file as it was left after the last sync.
#[derive(Debug)]
struct OpenFile {
    file: File,
    bytes: u64,
    lines: usize,
}

impl AlarmFile {
    /// Opens the file. One that is damaged is set aside, never deleted.
    pub fn open(path: &Path, now: Timestamp) -> (AlarmFile, RestoredAlarms) {
        let mut alarms =
            AlarmFile { path: path.to_owned(), events: LatestEvents::default(), unwritten: Vec::new(), file: None };
        let name = path.display();
        let found = match read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => RestoredAlarms::default(),
            Err(error) => RestoredAlarms { events: None, trouble: Some(format!("{name} cannot be read: {error}")) },
            Ok(bytes) => match parse_whole(&bytes) {
                Ok(events) => {
                    alarms.events = events;
                    let cut = is_cut(&bytes).then(|| {
                        let count = alarms.events.len();
                        format!(
                            "the state of the alarms ({name}) ends within a line: the power failed while it was \
                             written, or it was cut; its first {count} events are used"
                        )
                    });
                    RestoredAlarms { events: Some(alarms.events.iter().cloned().collect()), trouble: cut }
                }
                Err(why) => {
                    let aside = path.with_extension(format!("damaged-{}", now.strftime("%Y%m%dT%H%M%SZ")));
                    let kept = match fs::rename(path, &aside) {
                        Ok(()) => format!("set aside as {}", aside.display()),
                        Err(error) => format!("cannot be set aside: {error}"),
                    };
                    let why = format!("the state of the alarms is damaged ({name}: {why}), {kept}");
                    RestoredAlarms { events: None, trouble: Some(format!("{why}; taken from the journal instead")) }
                }
            },
        };
        (alarms, found)
    }

    /// Takes events; [`AlarmFile::write`] brings them to the disk.
    pub fn on_events(&mut self, events: impl IntoIterator<Item = AlarmRecord>) {
        for event in events {
            if self.file.is_some() {
                self.unwritten.push(event.clone());
            }
            self.events.on_event(event);
        }
    }

    /// Writes what is not on disk yet, and syncs it. After a failure the next try writes the whole file.
    pub fn write(&mut self) -> io::Result<()> {
        let file = self.file.take().filter(|written| written.may_grow(&self.path, self.events.len()));
        let unwritten = std::mem::take(&mut self.unwritten);
        self.file = Some(match file {
            Some(written) if unwritten.is_empty() => written,
            Some(written) => written.append(&unwritten)?,
            None => self.write_whole()?,
        });
        Ok(())
    }

    /// A power failure leaves the old file or the new one.
    fn write_whole(&self) -> io::Result<OpenFile> {
        let text: String = std::iter::once(HEADER.to_owned()).chain(self.events.iter().map(line)).collect();
        let file = atomic::write_placed(&self.path, text.as_bytes(), 0o640, |_, new| fs::rename(new, &self.path))?;
        Ok(OpenFile { file, bytes: text.len() as u64, lines: self.events.len() })
    }
}

impl OpenFile {
    /// Is it still the file that was left, and not too long?
    fn may_grow(&self, path: &Path, live: usize) -> bool {
        let same = fs::symlink_metadata(path).is_ok_and(|there| {
            let own = self.file.metadata().map(|own| (own.dev(), own.ino()));
            there.len() == self.bytes && own.is_ok_and(|own| own == (there.dev(), there.ino()))
        });
        same && self.lines <= 2 * live + SPARE_LINES
    }

    fn append(mut self, events: &[AlarmRecord]) -> io::Result<OpenFile> {
        let text: String = events.iter().map(line).collect();
        self.file.write_all(text.as_bytes())?;
        self.file.sync_data()?;
        Ok(OpenFile { bytes: self.bytes + text.len() as u64, lines: self.lines + events.len(), ..self })
    }
}

/// The beginning of a file that is too large to be read is not taken for all of it.
fn parse_whole(bytes: &[u8]) -> Result<LatestEvents, String> {
    if BYTES_MAX < bytes.len() as u64 {
        return Err(format!("it is larger than {} MiB", BYTES_MAX >> 20));
    }
    parse(bytes)
}

/// At most one byte more than the largest file has.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let file = regular::open(path)?;
    let mut bytes = Vec::new();
    file.take(BYTES_MAX + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::plant::{def::Priority, record::AlarmEvent};

    fn event(number: i64, event: AlarmEvent) -> AlarmRecord {
        let at = Timestamp::from_second(number).unwrap();
        AlarmRecord::new(at, &format!("T-{}", number % 3), "high", Priority::High, event)
    }

    /// What the next station finds.
    fn found(path: &Path) -> RestoredAlarms {
        AlarmFile::open(path, Timestamp::from_second(1_000_000).unwrap()).1
    }

    #[test]
    fn alarm_states_are_read_back_and_the_file_stays_small() {
        let folder = tempfile::tempdir().unwrap();
        let path = beside(&folder.path().join("tank.duckdb"));
        assert_eq!(found(&path), RestoredAlarms::default(), "no file yet");
        let (mut alarms, _) = AlarmFile::open(&path, Timestamp::UNIX_EPOCH);
        alarms.on_events([event(1, AlarmEvent::Raised)]);
        alarms.write().unwrap();
        for number in 0..3_000 {
            alarms.on_events([event(number, AlarmEvent::Raised), event(number, AlarmEvent::ReturnedToNormal)]);
            if number % 10 == 0 {
                alarms.write().unwrap();
            }
        }
        alarms.write().unwrap();
        let last = [2_997, 2_998, 2_999]
            .map(|number| [AlarmEvent::Raised, AlarmEvent::ReturnedToNormal].map(|kind| event(number, kind)));
        assert_eq!(found(&path), RestoredAlarms { events: Some(last.concat()), trouble: None });
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines < 2 * SPARE_LINES, "{lines} lines for 6 events");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside");
    }

    #[test]
    fn a_file_that_was_removed_or_changed_is_rewritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tank.alarms.state");
        let (mut alarms, _) = AlarmFile::open(&path, Timestamp::UNIX_EPOCH);
        alarms.on_events([event(1, AlarmEvent::Raised)]);
        alarms.write().unwrap();
        fs::remove_file(&path).unwrap();
        alarms.on_events([event(1, AlarmEvent::Acknowledged)]);
        alarms.write().unwrap();
        let both = vec![event(1, AlarmEvent::Raised), event(1, AlarmEvent::Acknowledged)];
        assert_eq!(found(&path).events, Some(both.clone()));
        fs::write(&path, "nonsense").unwrap();
        alarms.write().unwrap();
        assert_eq!(found(&path).events, Some(both));
    }

    #[test]
    fn after_a_failure_nothing_is_missing_once_the_disk_takes_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("later").join("tank.alarms.state");
        let (mut alarms, _) = AlarmFile::open(&path, Timestamp::UNIX_EPOCH);
        alarms.on_events([event(1, AlarmEvent::Raised)]);
        assert!(alarms.write().is_err());
        alarms.on_events([event(1, AlarmEvent::Acknowledged)]);
        assert!(alarms.write().is_err());
        fs::create_dir(folder.path().join("later")).unwrap();
        alarms.write().unwrap();
        assert_eq!(found(&path).events.unwrap().len(), 2);
    }

    #[test]
    fn a_damaged_file_is_set_aside_and_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tank.alarms.state");
        let (mut alarms, _) = AlarmFile::open(&path, Timestamp::UNIX_EPOCH);
        alarms.on_events([event(1, AlarmEvent::Raised), event(2, AlarmEvent::Raised)]);
        alarms.write().unwrap();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen("T-1", "T-7", 1)).unwrap();
        let RestoredAlarms { events, trouble } = found(&path);
        assert_eq!(events, None);
        assert!(trouble.unwrap().contains("line 2 is not as it was written"));
        assert!(!path.exists() && folder.path().join("tank.alarms.damaged-19700112T134640Z").exists());
        // A part of a file is never taken for all of it.
        let large = File::options().write(true).create(true).truncate(true).open(&path).unwrap();
        (&large).write_all(text.as_bytes()).unwrap();
        large.set_len(BYTES_MAX + 1).unwrap();
        let RestoredAlarms { events, trouble } = found(&path);
        assert_eq!(events, None);
        assert!(trouble.unwrap().contains("larger than 64 MiB"));
        // What is whole of a cut file counts, and that it was cut is said.
        fs::write(&path, &text[..text.len() - 9]).unwrap();
        let RestoredAlarms { events, trouble } = found(&path);
        assert_eq!(events.map(|events| events.len()), Some(1));
        assert!(trouble.unwrap().contains("ends within a line"));
    }
}
