//! What was found of a device before the start is known at once, and given up when the device is another one.

use super::{
    slave::{Line, line_with},
    *,
};
use crate::plant::{
    PlantDef,
    line_finding::{DeviceFinding, LineFinding},
    tag::Table,
};

const HOLE: DeviceFinding = DeviceFinding::Unreadable { table: Table::Holding, address: 11, count: 1 };

/// Goes on until a second; gives what is found of the first device at the end, and the failures of its blocks.
async fn found_until(line: &mut Line, def: &PlantDef, second: i64) -> (Vec<DeviceFinding>, usize) {
    let end = Timestamp::from_second(second).expect("a small number");
    let mut failures = 0;
    loop {
        match line.events.recv().await.expect("the line runs") {
            Event::Report { at, report, .. } => {
                let of_first = |finding: &LineFinding| match finding {
                    LineFinding::Device(DeviceId(0), found) => Some(*found),
                    _ => None,
                };
                if end <= at {
                    return (report.findings.iter().filter_map(of_first).collect(), failures);
                }
            }
            Event::Failed { device: DeviceId(0), tags, .. } => {
                failures += usize::from(tags.iter().any(|tag| def.tag(*tag).point.address != 11));
            }
            _ => {}
        }
    }
}

/// Refuses what touches address 11 until a second.
fn without_11_until(second: u64) -> impl FnMut(usize, &[u8]) -> SlaveAction {
    let since = tokio::time::Instant::now();
    move |_, message| {
        let touches = matches!(*message, [1, 3, 0, first, 0, count] if (first..first + count).contains(&11));
        let refused = touches && since.elapsed().as_secs() < second;
        if refused { SlaveAction::Exception(2) } else { SlaveAction::Answer }
    }
}

#[tokio::test(start_paused = true)]
async fn what_was_found_before_the_start_costs_no_reading() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut unknown = line(def.clone());
        unknown.plug(mode, without_11_until(u64::MAX));
        let (found, failures) = found_until(&mut unknown, &def, 20).await;
        assert_eq!(found, [HOLE], "{mode:?}");
        assert!(0 < failures, "{mode:?}: what shares a block with it was refused first");
        let mut known = line_with(def.clone(), found.iter().map(|found| (DeviceId(0), *found)).collect());
        known.plug(mode, without_11_until(u64::MAX));
        assert_eq!(found_until(&mut known, &def, 20).await, (found, 0), "{mode:?}");
    }
}

/// It was replaced while the station was off, while it was on, or without being off for long.
#[tokio::test(start_paused = true)]
async fn another_device_is_searched_again() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let found = vec![(DeviceId(0), HOLE)];
        let mut replaced = line_with(def.clone(), found.clone());
        replaced.plug(mode, without_11_until(0));
        assert_eq!(found_until(&mut replaced, &def, 10).await, (vec![], 0), "{mode:?}: before the start");
        let mut later = line_with(def.clone(), found);
        later.plug(mode, without_11_until(100));
        assert_eq!(found_until(&mut later, &def, 99).await, (vec![HOLE], 0), "{mode:?}");
        assert_eq!(found_until(&mut later, &def, 7_300).await, (vec![], 0), "{mode:?}: within two hours");
    }
}
