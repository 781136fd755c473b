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
