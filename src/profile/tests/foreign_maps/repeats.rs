//! Rows that stand for many.

use super::*;
use crate::plant::tag::{Decimals, Table};

fn meter(more: &str) -> String {
    format!("{METER}{more}\n")
}

fn loaded(meter: &str) -> PlantDef {
    load(PLANT.as_bytes(), meter, PLC).unwrap_or_else(|errors| panic!("{errors}"))
}

fn errors(meter: &str) -> String {
    let errors = load(PLANT.as_bytes(), meter, PLC).expect_err("it is wrong");
    errors.full_lines().collect::<Vec<_>>().join("\n")
}

const MPPT: &str = "[[repeat]]\ncount = 3\nstep = 20\n\
                    [[repeat.tag]]\nname = \"MPPT{n}.W\"\nlabel = \"power {n}\"\ntable = \"input\"\naddress = 5000\n\
                    type = \"uint16\"\nscale_from = \"MPPT{n}.W_SF\"\n\
                    [[repeat.tag]]\nname = \"MPPT{n}.W_SF\"\naddress = \"input:5001\"\ntype = \"int16\"\n";

#[test]
fn one_row_stands_for_many() {
    let plant = loaded(&meter(MPPT));
    let tag = |name: &str| plant.tag(plant.tag_named(name).unwrap_or_else(|| panic!("no {name}"))).clone();
    for (n, address) in [(1, 5000), (2, 5020), (3, 5040)] {
        let (value, power) = (tag(&format!("D1.MPPT{n}.W")), tag(&format!("D1.MPPT{n}.W_SF")));
        assert_eq!((value.point.table, value.point.address, power.point.address), (Table::Input, address, address + 1));
        assert_eq!((value.label, value.decimals), (format!("power {n}"), Decimals::PowerFrom(power.id)));
    }
    assert!(plant.tag_named("D1.MPPT4.W").is_none());
    let named = loaded(&meter(&MPPT.replace("count = 3", "names = [\"A\", \"B\"]")));
    assert!(named.tag_named("D1.MPPTB.W").is_some() && named.tag_named("D1.MPPT1.W").is_none());
}

#[test]
fn bits_and_coils_are_repeated_too() {
    let more = "[[repeat]]\ncount = 16\n[[repeat.tag]]\nname = \"AL{n}\"\ntable = \"input\"\naddress = 7\n\
                type = \"uint16\"\nfield = \"{i}\"\n\
                [[repeat]]\ncount = 30\nstep = 1\n[[repeat.tag]]\nname = \"K{n}\"\ntable = \"coil\"\naddress = 0x10\n\
                modicon = \"00017\"\naccess = \"rw\"\n";
    let plant = loaded(&meter(more));
    let point = |name: &str| plant.tag(plant.tag_named(name).unwrap()).point;
    assert_eq!((point("D1.AL1").field, point("D1.AL16").field), (Some((0, 1)), Some((15, 1))));
    assert_eq!((point("D1.K1").address, point("D1.K30").address), (16, 45));
}

#[test]
fn octal_addresses_go_on_in_octal() {
    let more =
        "\n[[repeat]]\ncount = 9\nstep = 1\n[[repeat.tag]]\nname = \"V{n}\"\naddress = \"V3000\"\ntype = \"uint16\"\n";
    let plant = load(PLANT.as_bytes(), METER, &format!("{PLC}{more}")).unwrap_or_else(|errors| panic!("{errors}"));
    let point = |name: &str| plant.tag(plant.tag_named(name).unwrap()).point;
    assert_eq!(point("PLC.V9").address, 0o3010);
}

#[test]
fn an_error_names_the_row_of_the_repeat_once() {
    let wrong = errors(&meter(&MPPT.replace("uint16", "uint17")));
    assert_eq!(wrong.matches("unknown type `uint17`").count(), 1, "{wrong}");
    assert!(wrong.contains("(`1`, 1 of 3 of a repeat)"), "{wrong}");
    let far = errors(&meter(&MPPT.replace("address = 5000", "address = 65500")));
    assert!(far.contains("65540 is out of range (`3`, 3 of 3 of a repeat)"), "{far}");
    for (from, to, expect) in [
        ("count = 3\n", "", "a repeat needs `count` or `names`"),
        ("count = 3", "count = 0", "a count of 0 is not possible"),
        ("count = 3", "count = 3\nnames = [\"A\"]", "1 names for a count of 3"),
        ("MPPT{n}.W\"\nlabel", "MPPT.W\"\nlabel", "duplicate tag `MPPT.W`"),
    ] {
        let found = errors(&meter(&MPPT.replacen(from, to, 1)));
        assert!(found.contains(expect), "{found}");
    }
}

#[test]
fn what_is_wrong_with_every_row_of_a_repeat_is_reported_once() {
    let once = |text: &str, expect: &str| {
        let found = errors(text);
        assert_eq!((found.lines().count(), found.contains(expect)), (1, true), "{found}");
    };
    let relays = "[[repeat]]\ncount = 3\nstep = 1\n[[repeat.tag]]\nname = \"K{n}\"\ntable = \"coil\"\naddress = 16\n\
                  access = \"rw\"\n";
    let knows = |functions: &str| meter(relays).replacen("status =", &format!("functions = {functions}\nstatus ="), 1);
    once(&knows("[1, 3, 4, 6]"), "D1.K1 needs function 5, which `functions` lacks");
    let found = errors(&knows("[3, 4, 6]"));
    assert_eq!(found.lines().count(), 2, "function 1 and function 5: {found}");
    let words = "[[repeat]]\ncount = 3\nstep = 1\n[[repeat.tag]]\nname = \"W{n}\"\ntable = \"input\"\naddress = 7\n\
                 type = \"uint32\"\n";
    once(&meter(words), "overlap with different types");
    once(
        &meter(&words.replace("step = 1", "step = 2").replace("uint32\"", "uint32\"\nunit_from = \"DP\"")),
        "DP gives no unit",
    );
    // Two devices of one profile are wrong in one place.
    let two = PLANT.replacen(
        "[[alarm]]",
        "[[device]]\nname = \"D2\"\nprofile = \"meter\"\nline = \"L1\"\nunit = 9\n[[alarm]]",
        1,
    );
    let both = load(two.as_bytes(), &knows("[1, 3, 4, 6]"), PLC).expect_err("it is wrong");
    assert_eq!(both.full_lines().filter(|line| line.contains("needs function 5")).count(), 1);
}

#[test]
fn a_device_says_how_many_of_a_repeat_it_has() {
    let text = |from: &str, more: &str| {
        meter(&format!(
            "[[tag]]\nname = \"N\"\ntable = \"holding\"\naddress = 2000\ntype = \"uint16\"\n{more}\n\
             [[repeat]]\ncount = 3\ncount_from = \"{from}\"\nstep = 1\n\
             [[repeat.tag]]\nname = \"S{{n}}\"\ntable = \"holding\"\naddress = 2010\ntype = \"uint16\"\n\
             [[repeat.tag]]\nname = \"T{{n}}\"\ntable = \"holding\"\naddress = 2020\ntype = \"uint16\"\nwhen = \"N < 9\"\n"
        ))
    };
    let plant = loaded(&text("N", ""));
    let of = |name: &str| plant.tag(plant.tag_named(name).unwrap());
    let holds = |name: &str, count: f64| {
        let when = of(name).when.as_ref().expect("a condition");
        when.holds(&|tag| (tag == of("D1.N").id).then_some(count.into()))
    };
    assert_eq!([1.0, 2.0, 3.0].map(|count| holds("D1.S3", count)), [Some(false), Some(false), Some(true)]);
    assert_eq!([0.0, 1.0].map(|count| holds("D1.S1", count)), [Some(false), Some(true)]);
    assert_eq!([3.0, 9.0].map(|count| holds("D1.T3", count)), [Some(true), Some(false)], "and its own condition");
    assert_eq!(of("D1.N").when, None);
    for (from, more, expect) in
        [("M", "", "M"), ("S1", "", "D1.S1 has a condition itself"), ("N", "poll = \"never\"", "D1.N is never read")]
    {
        let refused = errors(&text(from, more));
        assert!(refused.contains(expect), "{refused}");
    }
}

#[test]
fn what_is_not_there_has_no_alarm() {
    let text = meter(
        "[[tag]]\nname = \"FW\"\ntable = \"holding\"\naddress = 2000\ntype = \"uint16\"\n\
         [[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2001\ntype = \"uint16\"\nwhen = \"FW >= 210\"\n\
         [[alarm]]\ntag = \"X\"\nhigh = 5\ndeadband = 1\npriority = \"low\"\nmessage = \"X is high\"\n",
    );
    let plant = loaded(&text);
    let alarm = plant.alarms.iter().find(|alarm| &*alarm.message == "X is high").expect("an alarm of the profile");
    let fw = plant.tag_named("D1.FW").unwrap();
    let enabled =
        |version: f64| alarm.enabled_when.as_ref().unwrap().holds(&|tag| (tag == fw).then_some(version.into()));
    assert_eq!((enabled(209.0), enabled(210.0)), (Some(false), Some(true)));
}
