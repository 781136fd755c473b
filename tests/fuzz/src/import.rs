//! Samples of other programs: what is read is in order and of the past, and is the same when it is written and read again.

use jiff::Timestamp;
use sightglass::api::history::import::{Rows, parse};

use super::common::{TANK, now};

/// The file.
pub fn run(data: &[u8]) {
    let read = |bytes: &[u8]| parse(&TANK, bytes, Timestamp::UNIX_EPOCH, now());
    match read(data) {
        Err(problems) => {
            assert!(!problems.is_empty() && problems.iter().all(|why| !why.is_empty()), "refused without a reason")
        }
        Ok(rows) => {
            for samples in rows.values() {
                assert!(samples.is_sorted_by(|one, next| one.at < next.at), "in order");
                assert!(samples.iter().all(|sample| Timestamp::UNIX_EPOCH <= sample.at && sample.at <= now()));
            }
            assert_eq!(read(written(&rows).as_bytes()), Ok(rows));
        }
    }
}

fn written(rows: &Rows) -> String {
    let mut text = "time_utc,tag,value,quality\n".to_owned();
    for (tag, samples) in rows {
        for sample in samples {
            let value = sample.exact().map_or(String::new(), |value| value.to_string());
            text += &format!("{},{},{value},{}\n", sample.at, TANK.tag(*tag).name, sample.quality.word());
        }
    }
    text
}
