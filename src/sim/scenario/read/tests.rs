//! The content of a scenario file, and the message of each mistake.

use std::path::Path;

use super::*;
use crate::profile::{self, Search};

fn read_text(text: &str) -> Result<Scenario, Vec<String>> {
    let find = |plant: &str| profile::load(Path::new(plant), &Search::shipped());
    read("s", "s.toml", text.as_bytes(), &find).map(|(scenario, _)| scenario).map_err(|errors| errors.lines().collect())
}

const HEAD: &str = "title = 't'\nplant = 'tank'\nduration = '10m'\n";
const EXPECT: &str = "[[expect]]\nprocess = 'TIC-1.PV'\nnever_above = 90\n";

#[test]
fn everything_in_a_file_is_understood() {
    let text = format!(
        "{HEAD}start = 'rest'\nwarm_up = '1h'\npass_percent = 80\n\
         [[event]]\nat = '2m'\nfault = 'sensor burnout'\ndevice = 'TIC-1'\nfor = '30s'\n\
         [[event]]\nat = '1m'\nfault = 'leak 0.5 l/min'\n\
         [[event]]\nat = '1m'\nfault = 'noise 20 %'\nline = 'L1'\n\
         [[event]]\nat = '1m'\nfault = 'stuck value'\ntag = 'TIC-1.PV'\n\
         [[operator]]\nat = '3m'\nacknowledge = 'all'\n\
         [[operator]]\nat = '2m 30s'\nwrite = 'PLC-1.RUN'\nvalue = 'STOP'\n\
         [[expect]]\nalarm = 'TIC-1.FAULT'\nafter = '2m'\nwithin = '10s'\npoints = 7\n\
         [[expect]]\nalarm = 'TIC-1.PV'\nmessage = 'temperature high'\nnever = true\n{EXPECT}"
    );
    let scenario = read_text(&text).expect("a good scenario");
    let events: Vec<(u64, String, bool)> =
        scenario.events.iter().map(|e| (e.at.as_secs(), e.fault.to_string(), e.begins)).collect();
    let event = |at, fault: &str, begins| (at, fault.to_owned(), begins);
    assert_eq!(
        events,
        [
            event(60, "leak 0.5 l/min", true),
            event(60, "noise 20 %", true),
            event(60, "stuck value", true),
            event(120, "sensor burnout", true),
            event(150, "sensor burnout", false),
        ]
    );
    assert_eq!((scenario.start, scenario.warm_up, scenario.pass_percent), (Start::Rest, Duration::from_secs(3600), 80));
    assert_eq!(scenario.operator.iter().map(|step| step.at.as_secs()).collect::<Vec<_>>(), [150, 180]);
    assert_eq!((scenario.points(), scenario.expect[0].until), (27, Duration::from_secs(130)));
    assert_eq!(
        scenario.expect.iter().map(|expect| expect.text.as_str()).collect::<Vec<_>>(),
        [
            "alarm TIC-1.FAULT sensor or controller fault raised by 02:10",
            "no alarm TIC-1.PV temperature high",
            "TIC-1.PV really never above 90 °C",
        ]
    );
    assert_eq!(scenario.timeline(false).len(), 5);
    let at: Vec<u64> = scenario.timeline(true).iter().map(|event| event.at().as_secs()).collect();
    assert_eq!(at, [60, 60, 60, 120, 150, 150, 180]);
}

/// Each mistake with the line that it is found in.
#[test]
fn a_mistake_is_reported_with_line_found_and_expected() {
    let check = |text: &str, expect: &str| {
        let found = read_text(text).expect_err(expect);
        assert!(found.iter().any(|line| line == expect), "expected {expect}\nfound {found:#?}");
    };
    let event = |body: &str| format!("{HEAD}{EXPECT}[[event]]\nat = '1m'\n{body}");
    check("", "s.toml:1:1: s.toml is empty");
    check("plant = 'tank'\nduration = '1m'\n", "s.toml:1:1: the scenario needs `title`");
    check(HEAD, "s.toml:1:1: a scenario needs at least one [[expect]]");
    check(&format!("{HEAD}{EXPECT}speed = 2"), "s.toml:7:1: unknown key `speed` in an expectation");
    check(&event("fault = 'sensor burnot'\ndevice = 'TIC-1'"), "s.toml:9:9: unknown fault `sensor burnot`");
    check(
        &event("fault = 'late 2'\ndevice = 'TIC-1'"),
        "s.toml:9:9: found `late 2`, expected a time from 50ms to 60s, such as `late 2s`",
    );
    check(&event("fault = 'silent'"), "s.toml:7:1: where is `silent`?");
    check(&event("fault = 'silent'\nmended = true"), "s.toml:10:1: `mended` is now `clear`");
    let never_off = "[[expect]]\ndisplayed_within = 'TIC-1.PV'\ntolerance = -1\n";
    check(&format!("{HEAD}{never_off}"), "s.toml:6:13: found -1, expected 0 or more");
    check(&event("fault = 'silent'\ndevice = 'TIC-9'"), "s.toml:10:10: unknown device `TIC-9`");
    check(&event("fault = 'silent'\nline = 'L1'"), "s.toml:9:9: `silent` is a fault of a device, not of L1");
    check(&event("fault = 'torn value'\ndevice = 'TIC-1'"), "s.toml:9:9: TIC-1 has no value of 32 bits");
    check(&event("fault = 'leak 2'\nline = 'L1'"), "s.toml:9:9: `leak 2 l/min` is a fault of the process, not of L1");
    check(&format!("{HEAD}[[expect]]\nalarm = 'TIC-1.PV'\n"), "s.toml:5:9: TIC-1.PV has several alarms");
    check(&format!("{HEAD}[[expect]]\nprocess = 'TIC-1.PV'\n"), "s.toml:5:11: which bounds?");
    check(&format!("{HEAD}{EXPECT}after = '11m'\n"), "s.toml:7:9: the scenario is over at 10:00");
    check(
        &format!("{HEAD}{EXPECT}[[operator]]\nat = '1m'\nwrite = 'PLC-1.RUN'\nvalue = 'HALT'\n"),
        "s.toml:10:9: `HALT` is not a state of PLC-1.RUN",
    );
}

#[test]
fn a_plant_that_is_not_there_is_reported() {
    let found = read_text("title = 't'\nplant = 'tnk'\nduration = '1m'\n[[expect]]\ngood = 'A.B'\n");
    assert!(found.is_err_and(|lines| lines[0].contains("tnk")));
}
