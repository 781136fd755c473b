//! Alarms and what they need.

use super::*;

#[test]
fn an_alarm_that_could_never_come_or_never_go_is_refused() {
    check(
        "high = 80.0",
        "high = 120.0",
        &["[small.toml:26:8]", "the limit 120 is outside the range of D1.T", "it goes from 0 to 100"],
    );
    check("deadband = 1.0", "", &["a limit needs a `deadband`", "temperature 1 %"]);
    check("high = 80.0", "high = 80.0\nlow = 3.0", &["an alarm has one condition"]);
    check("high = 80.0\n", "", &["an alarm needs a condition"]);
    check("decimals_from", "poll = \"fast\"\nquality_from = \"Q\"\ndecimals_from", &["unknown tag `Q`"]);
    check("address = 1004", "address = 1004\npoll = \"never\"", &["D1.DP is never read, so D1.T can never be shown"]);
}

#[test]
fn the_alarm_of_an_overloaded_line_may_be_written() {
    let own = "[[alarm]]\nline = \"L1\"\noverloaded = true\npriority = \"high\"\nmessage = \"slow\"\n[mimic]";
    let plant = load(PLANT.replacen("[mimic]", own, 1).as_bytes(), METER, PLC).expect("a good plant");
    let found: Vec<_> = plant.alarms.iter().filter(|alarm| alarm.condition == Condition::Overloaded).collect();
    assert!(matches!(found[..], [alarm] if alarm.message == "slow" && alarm.subject == Subject::Line(LineId(0))));
    check("[mimic]", &own.replace("true", "false"), &["only a `line` can be overloaded", "expected `true`"]);
    check("[mimic]", &own.replace("line = \"L1\"", "device = \"D1\""), &["only a `line` can be overloaded"]);
    let own = own.replace("overloaded = true\n", "").replace("slow", "line overloaded");
    check("[mimic]", &own, &["duplicate alarm `line overloaded` of L1", "expected another message"]);
}

#[test]
fn a_device_with_a_stated_time_has_an_alarm_for_it() {
    let slow = |plant: &PlantDef| {
        let found = plant.alarms.iter().filter(|alarm| alarm.condition == Condition::SlowerThanStated);
        found.map(|alarm| (alarm.subject, alarm.priority, alarm.message.clone())).collect::<Vec<_>>()
    };
    let loaded = |plant: &str, meter: &str| load(plant.as_bytes(), meter, PLC).expect("a good plant");
    assert_eq!(slow(&loaded(PLANT, METER)), [], "nothing is stated");
    let meter = METER.replacen("[limits]", "[limits]\nresponse_time_ms = 30", 1);
    let usual = (Subject::Device(DeviceId(0)), Priority::Low, "slower than its profile states".to_owned());
    assert_eq!(slow(&loaded(PLANT, &meter)), [usual]);
    let own = "[[alarm]]\ndevice = \"D1\"\nslower_than_stated = true\npriority = \"high\"\nmessage = \"slow\"\n[mimic]";
    let plant = PLANT.replacen("[mimic]", own, 1);
    assert_eq!(slow(&loaded(&plant, &meter)), [(Subject::Device(DeviceId(0)), Priority::High, "slow".to_owned())]);
    check("[mimic]", &own.replace("true", "false"), &["only a `device` can be slower than stated", "expected `true`"]);
    check("[mimic]", &own.replace("device = \"D1\"", "line = \"L1\""), &["only a `device` can be slower"]);
}

#[test]
fn two_alarms_of_one_name_are_refused() {
    let second = "[[alarm]]\ntag = \"D1.T\"\nlow = 5.0\ndeadband = 1.0\npriority = \"low\"\nmessage = \"hot\"\n[mimic]";
    check("[mimic]", second, &["[small.toml:36:11]", "duplicate alarm `hot` of D1.T", "first here"]);
    let own = "[[alarm]]\ndevice = \"D1\"\nne107 = \"F\"\npriority = \"low\"\nmessage = \"not responding\"\n[mimic]";
    check("[mimic]", own, &["duplicate alarm `not responding` of D1", "expected another message"]);
}

#[test]
fn every_condition_says_what_it_lacks() {
    for (condition, expect) in [
        ("rate = 5.0", "`rate` needs `over`"),
        ("rate = 0.0\nover = \"1min\"", "a limit of 0 always holds"),
        ("rate = 0.5\nover = \"1min\"", "the alarm would never return"),
        ("changes = 10", "`changes` needs `within`"),
        ("changes = 1\nwithin = \"1min\"", "not a count of changes"),
        ("no_change = \"1ms\"", "this time is too short"),
        ("no_update = \"30s\"\nover = \"1min\"", "`over` belongs to `rate`"),
        ("bit = 3", "D1.T has no bit 3"),
        ("high = 80.0\nclass = \"proces\"", "did you mean `process`?"),
        ("high = 80.0\nre_alarm = \"5s\"", "too short: re-alarming so soon is a nuisance"),
    ] {
        check("high = 80.0", condition, &[expect]);
    }
    check("[mimic]", "[alarms]\nshelve_max = \"1s\"\n\n[mimic]", &["not a valid shelving time"]);
    check("tag = \"D1.T\"\nhigh = 80.0\ndeadband = 1.0", "line = \"L9\"", &["unknown line `L9`", "did you mean `L1`?"]);
}

#[test]
fn errors_of_enabled_when_are_shown_at_their_place() {
    use crate::plant::expr::{Compare, Expr};
    let enabled = |words: &str| {
        let text = PLANT.replacen("high = 80.0", &format!("high = 80.0\nenabled_when = '{words}'"), 1);
        load(text.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}")).alarms[0].enabled_when.clone()
    };
    let test = |compare, value| Expr::test(crate::plant::def::TagId(0), compare, value);
    let (above, below) = (test(Compare::Above, 5.0), test(Compare::AtMost, 2.5));
    for (words, expect) in [
        ("D1.T > 5", above.clone()),
        ("D1.T>5 °C", above.clone()),
        ("not D1.T > 5", Expr::Not(Box::new(above.clone()))),
        ("D1.T > 5 and D1.T <= 2.5", Expr::All(vec![above.clone(), below.clone()])),
        ("D1.T > 5 or D1.T <= 2.5 and D1.T > 5", {
            Expr::Any(vec![above.clone(), Expr::All(vec![below.clone(), above.clone()])])
        }),
        ("(D1.T > 5 or D1.T <= 2.5) and D1.T > 5", { Expr::All(vec![Expr::Any(vec![above.clone(), below]), above]) }),
    ] {
        assert_eq!(enabled(words), Some(expect), "{words}");
    }
    for (words, expect) in [
        ("D1.X > 5", &["unknown tag `D1.X`", "[small.toml:27:17]"][..]),
        ("D1.T > 5 cm", &["`cm` is not the unit of D1.T", "expected °C"]),
        ("D1.T > warm", &["`warm` is not a state of D1.T"]),
        ("D1.T", &["this is a number, not a condition"]),
        ("D1.T > ", &["D1.T is compared with nothing"]),
        ("D1.T > 5 and", &["a tag is missing"]),
        ("(D1.T > 5", &["a parenthesis is not closed"]),
        ("D1.T > 5)", &["`)` is one too many"]),
        ("", &["a tag is missing"]),
    ] {
        check("high = 80.0", &format!("high = 80.0\nenabled_when = '{words}'"), expect);
    }
    let deep = format!("{}D1.T > 5", "not ".repeat(50));
    check("high = 80.0", &format!("high = 80.0\nenabled_when = '{deep}'"), &["parentheses nested too deeply"]);
    // What is read from left to right is as deep as it is long.
    for long in ["D1.T + ".repeat(600), "D1.T * ".repeat(600), "D1.T > 5 or ".repeat(600)] {
        check("high = 80.0", &format!("high = 80.0\nenabled_when = '{long}D1.T > 5'"), &["the expression is too long"]);
    }
}

#[test]
fn limits_of_one_tag_stand_in_order() {
    let second = "[[alarm]]\ntag = \"D1.T\"\nhigh_high = 70.0\ndeadband = 1.0\npriority = \"critical\"\nmessage = \"very hot\"\n[mimic]";
    check("[mimic]", second, &["[small.toml:26:8]", "high 80 is not below high_high 70 of D1.T"]);
    // However many there are, each is named once for each level above it.
    let alarm = |level: &str, limit: f64, n: i32| {
        format!(
            "[[alarm]]\ntag = \"D1.T\"\n{level} = {limit:.1}\ndeadband = 1.0\npriority = \"low\"\nmessage = \"{level} {n}\"\n"
        )
    };
    let many =
        (0..50).map(|n| alarm("low", 90.0, n) + &alarm("high_high", 85.0, n) + &alarm("high_high", 95.0, n + 50));
    let text = PLANT.replace("[mimic]", &(many.collect::<String>() + "[mimic]"));
    let errors = load(text.as_bytes(), METER, PLC).expect_err("50 are above the high and the high high");
    assert_eq!(errors.count(), 100, "{errors}");
}

#[test]
fn the_id_of_an_alarm_is_one_word_and_that_of_no_other() {
    let own = |id: &str| format!("high = 80.0\nid = \"{id}\"");
    let plant = load(PLANT.replacen("high = 80.0", &own("tank-hot"), 1).as_bytes(), METER, PLC).expect("a good plant");
    assert!(plant.alarms.iter().any(|alarm| alarm.key.as_deref() == Some("tank-hot")));
    for id in ["", "tank hot"] {
        check("high = 80.0", &own(id), &["not a valid `id`", "expected one word"]);
    }
    let second =
        "[[alarm]]\ntag = \"D1.T\"\nlow = 5.0\ndeadband = 1.0\nid = \"hot\"\npriority = \"low\"\nmessage = \"cold\"\n";
    let both = format!("{second}{}[mimic]", second.replace("low = 5.0", "low_low = 2.0").replace("cold", "frozen"));
    check("[mimic]", &both, &["duplicate alarm `id` hot", "first here"]);
}
