//! Control runs, stored by a station that is killed now and then; a day of them against a computation of others.

use std::{fs, process::Command};

use super::*;
use crate::{
    history::io::tables::Tables,
    plant::{
        Plant,
        control_run::{ControlRun, DURATION_MAX, Figure, RunDef, RunState, STEADY_FOR},
        event::Event,
        fault::Fault,
        fixture::{self, DP, FAULT, PV, SV, TIC},
    },
    report::control_runs::RunPart,
    sim::{rig::Rig, slave::Unit},
};

/// Computes each figure from the stored samples alone, and compares it.
const CHECK: &str = include_str!("runs.py");

/// The fixture with the runs of its controller.
fn controlled() -> Arc<PlantDef> {
    let mut def = fixture::plant();
    def.runs = vec![RunDef {
        controller: TIC,
        sv: SV,
        sv_used: None,
        pv: PV,
        band: Some(0.5),
        steady_for: STEADY_FOR,
        duration_max: DURATION_MAX,
        energy: None,
        batches: Vec::new(),
        tags: vec![PV],
    }];
    Arc::new(def)
}

/// A station from one second to another, whose setpoint changes every 1000 s and whose PV is there after 20 s. It stops in
/// good order, or is killed.
fn station(db: &Path, def: &Arc<PlantDef>, seconds: std::ops::Range<i64>, stops: bool) {
    let opened = Store::open_at_start(db, def, sec(seconds.start)).unwrap();
    let mut plant = Plant::new(def.clone(), sec(seconds.start), 1.0);
    let store = opened.store;
    let mut records = plant.restore_runs(&opened.read.runs);
    for second in seconds {
        let (cycle, into) = (second / 1_000, second % 1_000);
        let sv = [20.0, 60.0][(cycle % 2) as usize];
        let pv = if into < 20 { 80.0 - sv } else { sv };
        let values = fixture::raw([(DP, 0.0), (FAULT, 0.0), (SV, sv), (PV, pv)]);
        let response_time = Duration::from_millis(9);
        let read =
            Event::Read { at: sec(second), device: TIC, values, texts: Vec::new(), response_time, exchange: None };
        records.extend(plant.on_event(read).records);
        // What is of no run waits for the next one: a commit a second takes long.
        if records.iter().any(|record| matches!(record, Record::Run(_))) {
            store.append(&std::mem::take(&mut records)).unwrap();
        }
    }
    if stops {
        store.append(&plant.on_stop().records).unwrap();
    }
}

fn runs(store: &Store, from: i64, to: i64, limit: usize) -> Vec<ControlRun> {
    match store.answer(&Query::ControlRuns { controller: None, from: sec(from), to: sec(to), limit }, sec(to)).unwrap()
    {
        Answer::ControlRuns(runs) => runs,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_run_outlives_a_kill_and_no_number_comes_twice() {
    let dir = tempfile::tempdir().unwrap();
    let db = dir.path().join("h.duckdb");
    let def = controlled();
    station(&db, &def, 0..2_700, false);
    station(&db, &def, 2_710..4_300, true);
    let store = Store::open_at_start(&db, &def, sec(5_000)).unwrap().store;
    let found = runs(&store, 0, 5_000, 10);
    let words: Vec<String> = found
        .iter()
        .map(|run| format!("{} {} {}..{}", run.label(), run.state.word(), run.from.as_second(), run.until.as_second()))
        .collect();
    let expect = [
        "TIC-1-4 interrupted 4000..4299",
        "TIC-1-3 ended 3000..4000",
        "TIC-1-2 interrupted 2000..2620",
        "TIC-1-1 ended 1000..2000",
    ];
    assert_eq!(words, expect, "the second run was stored last at its second 620");
    let first = found.last().unwrap();
    assert_eq!((first.at_sv, first.steady), (Figure::After(Duration::from_secs(20)), first.at_sv));
    assert_eq!((first.sv_before, first.sv, first.good), (Some(20.0), 60.0, 1.0));
    assert!((first.iae - 40.0 * 20.0 / 60.0).abs() < 1e-9, "{}", first.iae);
    assert_eq!(runs(&store, 2_500, 5_000, 2).len(), 2);
    assert_eq!(runs(&store, 2_500, 2_600, 9).iter().map(|run| run.number).collect::<Vec<_>>(), [2]);
    // What is read is what was written, to the last field.
    let again = Record::Run(Box::new(ControlRun { number: 9, energy: Some((0.25, 0.5)), ..first.clone() }));
    store.append(std::slice::from_ref(&again)).unwrap();
    let back = runs(&store, 0, 5_000, 10).into_iter().find(|run| run.number == 9).unwrap();
    assert_eq!(Record::Run(Box::new(back)), again);
}

#[test]
fn sql_has_the_runs_and_a_report_those_of_its_period() {
    let dir = tempfile::tempdir().unwrap();
    let db = dir.path().join("h.duckdb");
    let def = controlled();
    station(&db, &def, 0..3_100, false);
    let store = Store::open_at_start(&db, &def, sec(3_100)).unwrap().store;
    let report = store.report(&crate::report::Period::free(sec(1_100), sec(2_900)), sec(3_100)).unwrap();
    let numbers: Vec<u32> = report.control_runs.iter().map(|run| run.number).collect();
    assert_eq!(numbers, [2, 1], "the third began later");
    let Answer::Overview(overview) = store.answer(&Query::Overview, sec(3_100)).unwrap() else { panic!() };
    let folder = dir.path().join("sql");
    fs::create_dir(&folder).unwrap();
    let tables = Tables::new(&def, &overview, &folder).unwrap();
    tables.add_runs(&runs(&store, 0, 4_000, 10)).unwrap();
    let sql = "SELECT controller, number, state, at_sv_s, steady_s FROM run ORDER BY number";
    let (_, rows) = tables.rows(sql, 10).unwrap();
    let row = |row: &Vec<Option<String>>| row.iter().map(|cell| cell.clone().unwrap_or("-".into())).collect::<Vec<_>>();
    assert_eq!(row(&rows[0]), ["TIC-1", "1", "ended", "20.0", "20.0"]);
    assert_eq!(row(&rows[2]), ["TIC-1", "3", RunState::Running.word(), "20.0", "-"]);
}

#[test]
fn runs_of_a_closed_period_are_the_same_whenever_it_is_reported() {
    let dir = tempfile::tempdir().unwrap();
    let db = dir.path().join("h.duckdb");
    let def = controlled();
    let report = |from, to, now| {
        let store = Store::open_read_only(&db, &def).unwrap();
        let report = store.report(&crate::report::Period::free(sec(from), sec(to)), sec(now)).unwrap();
        (report.control_runs, report.run_parts)
    };
    let words = |(runs, parts): &(Vec<ControlRun>, Vec<RunPart>)| {
        let run = |run: &ControlRun| format!("{} {} ..{}", run.label(), run.state.word(), run.until.as_second());
        let part = |part: &RunPart| format!("{} part {}", part.run, part.lasted.as_secs());
        runs.iter().map(run).chain(parts.iter().map(part)).collect::<Vec<_>>()
    };
    // A run begins at 2000 and is at work at the end of one period, 2400. The station is killed in the next one, and a third
    // has none.
    station(&db, &def, 0..2_750, false);
    let periods = [(1_100, 2_400), (2_400, 2_900), (3_200, 3_500)];
    let at_once = periods[..2].iter().map(|(from, to)| report(*from, *to, 2_950)).collect::<Vec<_>>();
    assert_eq!(words(&at_once[0]), ["TIC-1-2 running ..2400", "TIC-1-1 ended ..2000", "TIC-1-1 part 900"]);
    assert_eq!(words(&at_once[1]), ["TIC-1-2 interrupted ..2620", "TIC-1-2 part 220"]);
    station(&db, &def, 3_600..5_300, true);
    let later = periods.map(|(from, to)| report(from, to, 5_300));
    assert_eq!(later[..2], at_once);
    assert_eq!(words(&later[2]), Vec::<String>::new());
}

/// A day of the simulated tank: the setpoint changes every 80 minutes, requests fail for some seconds or minutes, and the station
/// is killed at noon. Its PLC is not read.
fn day_of_the_tank(db: &Path, def: &Arc<PlantDef>) {
    let setpoints = [350.0, 450.0, 600.0, 580.0, 700.0, 650.0, 705.0, 720.0, 700.0];
    // From, to: around a change of the setpoint, a way up, and a time at SV.
    let silent =
        [4_796..4_803, 10_000..10_040, 14_700..14_990, 15_500..15_507, 30_000..30_600, 43_190..43_240, 60_000..60_012];
    let mut rig = Rig::filled(5.0);
    // Running, in manual, agitator and heater on.
    assert!(rig.plc().respond(&[15, 0x0C, 0, 0, 7, 1, 0b100_1001]).is_some());
    let mut plant = None;
    let mut written = 0.0;
    for second in 0..86_400i64 {
        if second % 43_200 == 0 {
            // The one before it is gone before this one opens its file.
            drop(plant.take());
            let opened = Store::open_at_start(db, def, sec(second)).unwrap();
            let mut fresh = Plant::new(def.clone(), sec(second), 1.0);
            opened.store.append(&fresh.restore_runs(&opened.read.runs)).unwrap();
            plant = Some((fresh, opened.store, Vec::new()));
        }
        let Some((plant, store, records)) = &mut plant else { panic!("it begins at 0") };
        let sv = setpoints[usize::try_from(second / 4_800).unwrap() % setpoints.len()];
        if sv != written {
            let [a, b] = (sv as u16).to_be_bytes();
            assert!(rig.controller().respond(&[6, 0x03, 0xEA, a, b]).is_some());
            written = sv;
        }
        let pv = (rig.state().pv_c * 10.0).round();
        let (at, device) = (sec(second), TIC);
        let values = fixture::raw([(DP, 1.0), (FAULT, 0.0), (SV, sv), (PV, pv)]);
        let (texts, response_time) = (Vec::new(), Duration::from_millis(9));
        let event = match silent.iter().any(|silent| silent.contains(&second)) {
            true => {
                let tags = vec![DP, FAULT, SV, PV];
                Event::Failed { at, device, tags, fault: Fault::Timeout, exchange: None }
            }
            false => Event::Read { at, device, values, texts, response_time, exchange: None },
        };
        records.extend(plant.on_event(event).records);
        records.extend(plant.on_tick(at).records);
        if second % 600 == 599 {
            store.append(&std::mem::take(records)).unwrap();
        }
        rig.advance(Duration::from_secs(1));
    }
}

#[test]
fn a_day_of_runs_is_what_others_compute_from_its_samples() {
    let dir = tempfile::tempdir().unwrap();
    let db = dir.path().join("h.duckdb");
    let mut def = PlantDef::clone(&controlled());
    def.tags.iter_mut().for_each(|tag| tag.deadband = Some(0.0));
    let def = Arc::new(def);
    day_of_the_tank(&db, &def);
    let store = Store::open_at_start(&db, &def, sec(86_400)).unwrap().store;
    let found = runs(&store, 0, 86_400, 100);
    let mut csv = String::from("tag,second,value,quality\n");
    for from in (0..86_400).step_by(1_800) {
        let query = Query::Unarchived { from: sec(from), to: sec(from + 1_800) };
        let Answer::Unarchived(samples) = store.answer(&query, sec(86_400)).unwrap() else { panic!() };
        let names = [SV, PV].map(|tag| def.tag(tag).name.clone());
        for (tag, sample) in &samples.samples {
            let (name, _) = &samples.tags[usize::from(*tag)];
            if !names.contains(name) {
                continue;
            }
            let value = sample.value.map_or(String::new(), |value| value.to_string());
            let second = sample.at.as_millisecond() as f64 / 1e3;
            csv += &format!("{name},{second},{value},{}\n", sample.quality.is_good());
        }
    }
    let (samples, listed) = (dir.path().join("samples.csv"), dir.path().join("runs.json"));
    fs::write(&samples, csv).unwrap();
    fs::write(&listed, serde_json::to_string(&found).unwrap()).unwrap();
    let output = match Command::new("python3").args(["-c", CHECK]).args([&samples, &listed]).output() {
        Err(error) if std::env::var_os("CI").is_none() => return eprintln!("skipped: python3: {error}"),
        output => output.unwrap(),
    };
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(said.trim(), format!("{} runs", found.len()));
    assert!(16 <= found.len(), "{said}");
}
