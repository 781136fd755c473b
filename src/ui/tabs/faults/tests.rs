//! The tab as a trainer uses it: what a key sends, what the screen shows, and where the tab is not offered.

use std::{sync::Arc, time::Duration};

use jiff::SignedDuration;

use crate::{
    plant::def::LineId,
    sim::{
        drill::{Progress, SimCommand, Status},
        faults::{ActiveFault, AvailableFaults, FaultTarget, InjectedFault, TargetKind},
        scenario::judge::{DrillResult, ExpectationStatus, Row},
    },
    ui::{
        Effect, Model, Msg,
        fixture::{self, Fixture},
        tabs::Tab,
        tests::{LANGUAGES, assert_acts_only_on_what_was_drawn, model, screen, type_keys},
        theme::Theme,
        update,
    },
};

const L1: LineId = LineId(0);
const TIC: FaultTarget = FaultTarget::Unit(L1, 1);

/// TIC-1 is silent and TK-1 leaks; the screen does not know yet that the valve is open.
fn status(fixture: &Fixture) -> Status {
    let of = |target: FaultTarget| {
        let faults = InjectedFault::all().filter(|fault| target.accepts(*fault)).collect();
        AvailableFaults { target, faults }
    };
    let since = fixture::now() - SignedDuration::from_secs(42);
    let actual = [("TIC-1.PV", 68.0), ("PLC-1.LT-1", 22.0), ("PLC-1.SV-2", 1.0), ("PLC-1.POWER", 670.0)];
    Status {
        available: [FaultTarget::Line(L1), TIC, FaultTarget::Unit(L1, 2), FaultTarget::Process].map(of).into(),
        active: vec![
            ActiveFault { target: TIC, fault: InjectedFault::Silent, since },
            ActiveFault { target: FaultTarget::Process, fault: InjectedFault::Leak(500), since },
        ],
        actual: actual.into_iter().map(|(name, value)| (fixture.tag(name), value)).collect(),
        exam: false,
        scenario: None,
    }
}

fn drill(over: bool) -> Progress {
    let row = |text: &str, status| Row { text: text.to_owned(), points: 20, status };
    let rows = vec![
        row("TIC-1.PV shown as not good by 02:05", ExpectationStatus::Met(Duration::from_secs(121))),
        row(
            "alarm TIC-1.FAULT sensor or controller fault acknowledged by 03:00",
            ExpectationStatus::Missed("did not happen in time".to_owned()),
        ),
        row(
            "TIC-1.PV really never above 90 °C",
            if over { ExpectationStatus::Met(Duration::from_secs(480)) } else { ExpectationStatus::Open },
        ),
    ];
    let points = if over { 40 } else { 20 };
    let verdict = DrillResult {
        title: "Sensor burnout while heating".to_owned(),
        rows,
        points,
        of: 60,
        pass_percent: 100,
        over,
        lost: 0,
    };
    let elapsed = Duration::from_secs(if over { 480 } else { 185 });
    Progress {
        description: "The controller knows that its sensor is broken.".to_owned(),
        elapsed,
        duration: Duration::from_secs(480),
        verdict,
    }
}

fn with(fixture: &Fixture, status: Status, theme: Theme) -> Model {
    let mut model = model(fixture, theme);
    update(&mut model, Msg::Extension(Arc::new(status)));
    screen(&mut model, 80, 24);
    model.tabs.shown = Tab::Faults;
    model
}

fn press(model: &mut Model, keys: &str) -> Vec<SimCommand> {
    let command = |effect| match effect {
        Effect::Extension(message) => message.get::<SimCommand>().copied(),
        _ => None,
    };
    type_keys(model, keys).into_iter().filter_map(command).collect()
}

#[test]
fn faults_go_on_and_off_by_enter_with_their_numbers() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, status(&fixture), Theme::FULL);
    assert_eq!(press(&mut model, "⏎"), [SimCommand::Inject(FaultTarget::Line(L1), InjectedFault::Noise(10))]);
    assert_eq!(press(&mut model, "→→⏎"), [SimCommand::Inject(FaultTarget::Line(L1), InjectedFault::Noise(50))]);
    assert_eq!(press(&mut model, "↓⏎"), [SimCommand::Clear(TIC, InjectedFault::Silent)], "what is on goes off");
    let late = InjectedFault::Late(Duration::from_secs(1));
    assert_eq!(press(&mut model, "↓←⏎"), [SimCommand::Inject(TIC, late)], "a number is set before it is on");
    assert_eq!(press(&mut model, "c"), [SimCommand::ClearAll]);
    assert_eq!(press(&mut model, "↑↑↑↑↑"), []);
    assert_eq!(press(&mut model, "⏎"), [SimCommand::Inject(FaultTarget::Line(L1), InjectedFault::Noise(50))]);
}

#[test]
fn clearing_faults_polls_silent_devices_at_once() {
    use crate::plant::{command::CommandKind, def::DeviceId, line_state::DeviceState};
    let mut fixture = Fixture::normal();
    fixture.devices[0].state = DeviceState::Down { since: fixture::now() };
    let mut model = with(&fixture, status(&fixture), Theme::FULL);
    let retried = |effects: Vec<Effect>| -> Vec<DeviceId> {
        let command = |effect| match effect {
            Effect::Command(command, _) => Some(command.kind),
            _ => None,
        };
        let refreshed = |kind| if let CommandKind::Refresh(device) = kind { Some(device) } else { None };
        effects.into_iter().filter_map(command).filter_map(refreshed).collect()
    };
    assert_eq!(retried(type_keys(&mut model, "c")), [DeviceId(0)]);
    assert_eq!(retried(type_keys(&mut model, "↓⏎")), [DeviceId(0)], "also when one fault is cleared");
    assert_eq!(retried(type_keys(&mut model, "↓⏎")), [], "not when one is set");
}

#[test]
fn a_fault_is_switched_only_as_it_was_drawn() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, status(&fixture), Theme::FULL);
    // Another operator of the demonstration sets it first: Enter, meant to set it, would clear it.
    let mut set = status(&fixture);
    set.active.push(ActiveFault {
        target: FaultTarget::Line(L1),
        fault: InjectedFault::Noise(10),
        since: fixture::now(),
    });
    let set = |model: &mut Model| drop(update(model, Msg::Extension(Arc::new(set))));
    assert_acts_only_on_what_was_drawn(&mut model, set, "⏎");
}

#[test]
fn the_number_of_a_fault_in_force_changes_at_once() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, status(&fixture), Theme::FULL);
    let leak = InjectedFault::all().position(|fault| matches!(fault, InjectedFault::Leak(_))).expect("a leak");
    let process = InjectedFault::all()
        .position(|fault| fault.target_kind() == TargetKind::Process)
        .expect("faults of the process");
    let units = 2 * (process - 1);
    press(&mut model, &"↓".repeat(1 + units + leak - process));
    assert_eq!(press(&mut model, "→"), [SimCommand::Inject(FaultTarget::Process, InjectedFault::Leak(1_000))]);
    assert_eq!(press(&mut model, "←"), [SimCommand::Inject(FaultTarget::Process, InjectedFault::Leak(200))]);
}

#[test]
fn the_tab_is_only_where_a_plant_is_simulated() {
    let fixture = Fixture::normal();
    let mut real = model(&fixture, Theme::FULL);
    press(&mut real, "8");
    let shown = screen(&mut real, 80, 24);
    assert!(!shown.contains("Faults") && !shown.contains("DEMO"), "{shown}");
    assert_eq!(real.tabs.shown, Tab::Mimic);
    let exam = Status { exam: true, scenario: Some(drill(false)), ..status(&fixture) };
    let mut trainee = with(&fixture, exam.clone(), Theme::FULL);
    trainee.tabs.shown = Tab::Mimic;
    press(&mut trainee, "8");
    let shown = screen(&mut trainee, 80, 24);
    assert!(shown.contains("EXAM") && !shown.to_lowercase().contains("fault"), "{shown}");
    update(&mut trainee, Msg::Extension(Arc::new(Status { scenario: Some(drill(true)), ..exam })));
    press(&mut trainee, "8");
    let shown = screen(&mut trainee, 80, 24);
    assert!(shown.contains("DEMO 2 FAULTS") && shown.contains("FAILED"), "{shown}");
}

#[test]
fn faults_and_truth_at_every_size() {
    let fixture = Fixture::normal();
    for (name, size, theme, keys) in [
        ("faults_80x24", (80, 24), Theme::FULL, "↓↓"),
        ("faults_120x40", (120, 40), Theme::FULL, "↓"),
        ("faults_end_80x24", (80, 24), Theme::FULL, &*"↓".repeat(99)),
        ("faults_ascii", (80, 24), Theme::PLAIN, "↓"),
    ] {
        let mut model = with(&fixture, status(&fixture), theme);
        press(&mut model, keys);
        let shown = screen(&mut model, size.0, size.1);
        assert!(theme != Theme::PLAIN || shown.is_ascii(), "{shown}");
        insta::assert_snapshot!(name, shown);
    }
    let with_drill = Status { scenario: Some(drill(true)), ..status(&fixture) };
    let mut model = with(&fixture, with_drill, Theme::FULL);
    insta::assert_snapshot!("faults_drill_80x24", screen(&mut model, 80, 24));
    press(&mut model, "v");
    insta::assert_snapshot!("faults_verdict_80x24", screen(&mut model, 80, 24));
}

#[test]
fn every_tab_has_its_number_on_the_smallest_screen() {
    let fixture = Fixture::normal();
    for language in LANGUAGES {
        for tab in Tab::ALL.into_iter().filter(|tab| *tab != Tab::Registers) {
            let mut model = with(&fixture, status(&fixture), Theme::FULL);
            model.locale = language.locale();
            model.tabs.shown = tab;
            let shown = screen(&mut model, 60, 20);
            let bar = shown.lines().nth(1).unwrap_or_default();
            let missing = (0..9).find(|number| !bar.contains(&format!("{number} ")));
            assert_eq!(missing, None, "{} {tab:?}: {bar}", language.code());
        }
    }
}

#[test]
fn a_heading_is_not_cut_where_there_is_room() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, status(&fixture), Theme::FULL);
    model.locale = crate::text::Language::THAI.locale();
    let shown = screen(&mut model, 80, 24);
    let heading = shown.lines().find(|line| line.trim_start().starts_with("TIC-1 ")).unwrap_or_default();
    assert!(heading.contains("L1"), "{shown}");
}
