//! A device whose register map stands in the plant file, signatures of profiles, and limits of tables.

use super::*;
use crate::plant::tag::Table;

const OWN: &str = r#"title = "Bench"
time_zone = "UTC"

[[line]]
name = "L1"
mode = "tcp"
host = "10.0.0.7"

[[device]]
name = "D1"
vendor = "ACME"
model = "M1"
line = "L1"
unit = 1
limits = { read_registers_max = 20 }
default = { table = "holding", type = "int16" }
faceplate = { pv = "T", sv = "SV" }
tag = [
    { name = "T", address = 1002, scale = 0.1, unit = "°C" },
    { name = "SV", address = 1003, access = "rw" },
]
"#;

fn refused(from: &str, to: &str, expect: &[&str]) {
    assert!(OWN.contains(from), "no `{from}`");
    let errors = load(OWN.replacen(from, to, 1).as_bytes(), METER, PLC).expect_err("it is wrong").to_string();
    for piece in expect {
        assert!(errors.contains(piece), "no `{piece}` in\n{errors}");
    }
}

#[test]
fn tags_may_stand_in_the_plant_file_alone() {
    let plant = load(OWN.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    let device = &plant.devices[0];
    assert_eq!((device.model.as_str(), device.limits.read_registers_max), ("ACME M1", 20));
    assert_eq!(device.profile, "D1", "its map is its own");
    assert!(device.faceplate.is_some());
    let tag = plant.tag(plant.tag_named("D1.T").unwrap());
    assert_eq!((tag.point.address, tag.point.kind, tag.scale, tag.unit.as_str()), (1002, DataType::I16, 0.1, "°C"));
}

#[test]
fn wrong_inline_tags_name_file_and_line() {
    refused("address = 1003", "address = 70000", &["small.toml:20:"]);
    refused("sv = \"SV\"", "sv = \"S\"", &["small.toml:17:"]);
    refused("model = \"M1\"", "modell = \"M1\"", &["small.toml:12:1", "unknown key `modell`", "model"]);
    refused(
        "vendor = \"ACME\"",
        "profile = \"meter\"",
        &["small.toml:12:", "`model` is written in the profile `meter`"],
    );
    let (without, _) = OWN.split_once("tag = [").unwrap();
    let errors = load(without.as_bytes(), METER, PLC).expect_err("no tags").to_string();
    assert!(errors.contains("needs `profile`, or tags of its own"), "{errors}");
}

#[test]
fn a_probe_of_a_signature_says_what_its_tag_must_hold() {
    let with = |probe: &str| OWN.to_owned() + &format!("signature = {{ probe = [{probe}] }}\n");
    let plant = load(
        with("{ tag = \"T\", range = [-5, 9] }, { tag = \"SV\", is = [1, 3] }, { tag = \"T\", is = [7] }").as_bytes(),
        METER,
        PLC,
    );
    let probes = plant.map(|plant| plant.devices[0].signature.clone()).unwrap_or_else(|errors| panic!("{errors}"));
    let ranges: Vec<_> = probes.into_iter().map(|probe| probe.ranges).collect();
    assert_eq!(ranges, [vec![(-5.0, 9.0)], vec![(1.0, 1.0), (3.0, 3.0)], vec![(7.0, 7.0)]]);
    for (probe, expect) in [
        ("{ tag = \"T\" }", "expected one of `is`"),
        ("{ tag = \"T\", is = [5] }, { tag = \"SV\", is = [6] }", "a signature of 2 probes can never fit"),
        (
            "{ tag = \"T\", is = [5] }, { tag = \"SV\", is = [6] }, { tag = \"SV\", is = [5] }",
            "3 different numbers among its probes",
        ),
        ("{ tag = \"T\", range = [40000, 50000] }", "a raw number of int16 is -32768 to 32767"),
        ("{ tag = \"T\", range = [9, 1] }", "is empty"),
        ("{ tag = \"TT\", is = [0] }", "small.toml:22:"),
    ] {
        let errors = load(with(probe).as_bytes(), METER, PLC).expect_err(probe).to_string();
        assert!(errors.contains(expect), "no `{expect}` in\n{errors}");
    }
}

#[test]
fn a_tag_has_its_own_role_or_that_of_its_group() {
    let grouped = OWN.replace("address = 1003,", "address = 1003, group = \"Tuning\",");
    let role = |text: &str| {
        let plant = load(text.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}"));
        plant.tag(plant.tag_named("D1.SV").unwrap()).role
    };
    let roles = "unit = 1\nroles = { Tuning = \"supervisor\" }";
    assert_eq!(role(&grouped), Role::Technician);
    let with_roles = grouped.replace("unit = 1", roles);
    assert_eq!(role(&with_roles), Role::Supervisor);
    assert_eq!(
        role(&with_roles.replace("address = 1003,", "address = 1003, role = \"technician\",")),
        Role::Technician
    );
    refused("unit = 1", roles, &["small.toml:15:", "unknown group `Tuning`"]);
    refused("access = \"rw\"", "access = \"rw\", role = \"viewer\"", &["small.toml:20:", "a viewer writes nothing"]);
}

#[test]
fn a_plant_file_says_who_may_write_what_a_profile_has() {
    let profile = "[roles]\nTuning = \"supervisor\"\n";
    let meter = METER.replacen("[[tag]]", &format!("{profile}\n[[tag]]\ngroup = \"Tuning\"\naccess = \"rw\""), 1);
    let role = |own: &str| {
        let text = PLANT.replacen("fast = \"1s\"", &format!("fast = \"1s\"\n{own}"), 1);
        let plant = load(text.as_bytes(), &meter, PLC).unwrap_or_else(|errors| panic!("{errors}"));
        plant.tag(plant.tag_named("D1.T").unwrap()).role
    };
    assert_eq!(role(""), Role::Supervisor);
    assert_eq!(role("roles = { Tuning = \"technician\" }"), Role::Technician);
    assert_eq!(role("[[device.tag]]\nname = \"T\"\nrole = \"technician\""), Role::Technician);
}

#[test]
fn a_table_has_limits_of_its_own() {
    let own = "alignment = 1\n[limits.input]\nread_max = 16\ngap_max = 0\nalignment = 2\n[limits.coil]\nalignment = 8";
    let def = load(PLANT.as_bytes(), &METER.replace("alignment = 1", own), PLC).expect("it is right");
    let limits = def.devices[0].limits;
    let of = |table: Table| (limits.most(table), limits.gap(table), limits.step(table));
    assert_eq!([of(Table::Input), of(Table::Holding)], [(16, 0, 2), (60, 8, 1)]);
    assert_eq!([of(Table::Coil), of(Table::Discrete)], [(2_000, 128, 8), (2_000, 128, 1)]);
    let wrong = |own: &str, expect: &[&str]| check("alignment = 1", &format!("alignment = 1\n{own}"), expect);
    wrong("[limits.input]\nread_max = 126", &["read_max = 126 is not possible", "allows 1 to 125"]);
    wrong("[limits.coil]\nalignment = 3", &["alignment = 3 is not known", "1, 2, 4, 8 or 16"]);
    wrong("[limits.holding]\nalignment = 8", &["alignment = 8 is not known", "expected 1, 2 or 4"]);
    wrong("[limits.inputs]\nread_max = 3", &["inputs"]);
}
