//! Maps as the world writes them: addresses beyond 10000, patterns of bits, defaults for registers beside coils and texts.

use super::*;
use crate::plant::{
    exact::Exact,
    tag::{Decimals, Table, TagDef},
};

fn meter(more: &str) -> String {
    format!("{METER}{more}\n")
}

fn loaded(meter: &str) -> PlantDef {
    load(PLANT.as_bytes(), meter, PLC).unwrap_or_else(|errors| panic!("{errors}"))
}

fn tag(meter: &str, name: &str) -> TagDef {
    let plant = loaded(meter);
    plant.tag(plant.tag_named(name).unwrap()).clone()
}

fn errors(meter: &str) -> String {
    load(PLANT.as_bytes(), meter, PLC).expect_err("it is wrong").to_string()
}

fn warnings(meter: &str) -> Vec<String> {
    let (_, warnings) = load_warned(PLANT.as_bytes(), meter, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    warnings.full_lines().filter(|line| line.starts_with("meter.toml")).collect()
}

#[test]
fn digits_of_a_modicon_number_are_warned_about_once_a_file() {
    let far = "[[tag]]\nname = \"W\"\ntable = \"holding\"\naddress = 40083\ntype = \"int16\"\n\
               [[tag]]\nname = \"VA\"\ntable = \"holding\"\naddress = 40085\ntype = \"int16\"\n";
    let said = warnings(&meter(far));
    assert_eq!(said.len(), 1, "{said:?}");
    for piece in ["40083 is read as sent", "Modicon 440084", "holding 82 (0x0052)", "address_base = 0"] {
        assert!(said[0].contains(piece), "no `{piece}` in {said:?}");
    }
    assert_eq!(tag(&meter(far), "D1.W").point.address, 40_083);
    let settled = [
        meter(far).replacen("vendor", "address_base = 0\nvendor", 1),
        meter(far).replace("40083", "0x9C93").replace("40085", "\"holding:40085\""),
        meter(&far.replace("holding", "input")),
    ];
    for meter in settled {
        assert_eq!(warnings(&meter), Vec::<String>::new(), "{meter}");
    }
    let modicon = meter(&far.replace("40083", "400083"));
    for piece in ["400083 is a Modicon number: holding 82", "modicon = 400083"] {
        assert!(errors(&modicon).contains(piece), "{}", errors(&modicon));
    }
    let other = meter("[[tag]]\nname = \"W\"\ntable = \"input\"\naddress = \"holding:5\"\ntype = \"int16\"\n");
    assert!(errors(&other).contains("this address is a holding, not a input"), "{}", errors(&other));
}

#[test]
fn a_pattern_of_bits_means_no_value_whatever_the_type() {
    for (kind, mark, raw) in [
        ("int16", "0x8000", Exact::whole(-32_768)),
        ("int16", "32768", Exact::whole(-32_768)),
        ("uint64", "0xFFFFFFFFFFFFFFFF", Exact::whole(u64::MAX.into())),
        ("uint64", "-1", Exact::whole(u64::MAX.into())),
        ("float32", "0xFF7FFFFF", f64::from(f32::MIN).into()),
        ("float32", "-9999", Exact::whole(-9_999)),
        ("bcd16", "0x9999", Exact::whole(9_999)),
    ] {
        let text = format!(
            "[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"{kind}\"\nbad_if = [{mark}]\n"
        );
        let tag = tag(&meter(&text), "D1.X");
        assert!(tag.is_bad(raw), "{kind} {mark}: {:?}", tag.bad_if);
        assert!(!tag.is_bad(0.0.into()), "{kind} {mark}");
        assert_eq!(warnings(&meter(&text)), Vec::<String>::new(), "{kind} {mark}");
    }
    let never =
        meter("[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"int16\"\nbad_if = [0x18000]\n");
    let said = warnings(&never);
    assert!(said.len() == 1 && said[0].contains("never reads as this") && said[0].contains("0xFFFF"), "{said:?}");
}

#[test]
fn marks_of_a_profile_are_those_of_each_type() {
    let map =
        "[default]\ntable = \"holding\"\nbad_if = { int16 = [0x8000], uint16 = [0xFFFF], uint32 = [0xFFFFFFFF] }\n";
    let tags = "[[tag]]\nname = \"A\"\naddress = 2000\ntype = \"int16\"\n[[tag]]\nname = \"B\"\naddress = 2001\ntype = \"uint16\"\n\
                [[tag]]\nname = \"C\"\ntable = \"coil\"\naddress = 5\n[[tag]]\nname = \"S\"\naddress = 2010\ntype = \"string(8)\"\n";
    let meter =
        format!("{}{map}{}{tags}", &METER[..METER.find("[[tag]]").unwrap()], &METER[METER.find("[[tag]]").unwrap()..]);
    let plant = loaded(&meter);
    let bad = |name: &str| plant.tag(plant.tag_named(name).unwrap()).bad_if.clone();
    assert_eq!(bad("D1.A"), [Exact::whole(-32_768)]);
    assert_eq!(bad("D1.B"), [Exact::whole(65_535)], "0x8000 is a value of this type");
    assert_eq!((bad("D1.C"), bad("D1.S")), (Vec::new(), Vec::new()));
    assert_eq!(warnings(&meter), Vec::<String>::new());
}

#[test]
fn patterns_name_states_probes_and_the_values_of_interlocks() {
    let state = meter(
        "[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"int16\"\nenum = { 0 = \"off\", 0xFFFF = \"on\" }\n\
         [[tag]]\nname = \"Y\"\ntable = \"holding\"\naddress = 2001\ntype = \"int16\"\n\
         [signature]\nprobe = [{ tag = \"X\", is = [0xFFFF, 0] }]\n",
    );
    assert_eq!(tag(&state, "D1.X").label_of(-1.0), Some("on"));
    let signature = &loaded(&state).devices[0].signature;
    assert_eq!(signature[0].ranges, [(-1.0, -1.0), (0.0, 0.0)]);
    let alarm = "[[alarm]]\ntag = \"D1.Y\"\nis = 0xFFFF\npriority = \"high\"\nmessage = \"fault\"\n\n[mimic]";
    let plant =
        load(PLANT.replace("[mimic]", alarm).as_bytes(), &state, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    assert!(plant.alarms.iter().any(|alarm| alarm.condition == Condition::State { is: -1.0 }));
    let impossible = state.replace("is = [0xFFFF, 0]", "is = [0x1FFFF]");
    assert!(errors(&impossible).contains("D1.X never reads as 131071"), "{}", errors(&impossible));
}

#[test]
fn a_field_of_a_signed_type_has_a_sign_and_a_float_has_none() {
    let half = |kind: &str| {
        meter(&format!(
            "[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"{kind}\"\nfield = \"7-0\"\nmin = -128\n"
        ))
    };
    assert_eq!(tag(&half("int16"), "D1.X").point.raw_range(), Some((-128, 127)));
    assert!(errors(&half("uint16")).contains("min -128 is outside what the register can hold"));
    let float = errors(&half("float32"));
    for piece in ["[meter.toml:44:8]", "type float32 has no field of bits", "such as uint16"] {
        assert!(float.contains(piece), "no `{piece}` in\n{float}");
    }
}

#[test]
fn defaults_of_registers_leave_coils_and_texts_alone() {
    let defaults = "[default]\ntable = \"holding\"\ntype = \"int16\"\norder = \"CDAB\"\nscale = 0.1\nunit = \"V\"\n";
    let tags = "[[tag]]\nname = \"RUN\"\ntable = \"coil\"\naddress = 5\n[[tag]]\nname = \"IN\"\naddress = \"discrete:6\"\n\
                [[tag]]\nname = \"S\"\naddress = 2010\ntype = \"string(8)\"\n[[tag]]\nname = \"U\"\naddress = 2020\n";
    let meter = format!(
        "{}{defaults}{}{tags}",
        &METER[..METER.find("[[tag]]").unwrap()],
        &METER[METER.find("[[tag]]").unwrap()..]
    );
    let plant = loaded(&meter);
    let tag = |name: &str| plant.tag(plant.tag_named(name).unwrap());
    let run = tag("D1.RUN");
    assert_eq!((run.point.table, run.point.kind, run.scale, run.unit.as_str()), (Table::Coil, DataType::Bool, 1.0, ""));
    assert_eq!((tag("D1.IN").point.table, tag("D1.IN").point.address), (Table::Discrete, 6));
    assert_eq!((tag("D1.S").unit.as_str(), tag("D1.S").scale), ("", 1.0));
    assert_eq!((tag("D1.U").unit.as_str(), tag("D1.U").point.kind), ("V", DataType::I16));
    let own = meter.replace("table = \"coil\"\naddress = 5", "table = \"coil\"\naddress = 5\ntype = \"int16\"");
    assert!(errors(&own).contains("a coil is one bit"), "what the row itself says is still wrong");
}

#[test]
fn a_signed_power_of_ten_is_no_number_of_decimals() {
    let signed = METER.replace("address = 1004\ntype = \"uint16\"", "address = 1004\ntype = \"int16\"");
    for piece in ["[meter.toml:17:17]", "D1.DP may hold a power of ten", "scale = -1"] {
        assert!(errors(&signed).contains(piece), "{}", errors(&signed));
    }
    for settled in ["int16\"\nscale = -1", "int16\"\nmin = 0", "int16\"\nenum = { 0 = \"0\", 1 = \"1\" }"] {
        loaded(&signed.replace("address = 1004\ntype = \"int16\"", &format!("address = 1004\ntype = \"{settled}")));
    }
}

#[test]
fn any_text_is_a_unit_and_a_known_one_has_one_spelling() {
    for (written, unit) in
        [("degC", "°C"), ("m3/hr", "m³/h"), ("kVArh", "kvarh"), ("imp", "imp"), ("mg/m³", "mg/m³"), ("GJ", "GJ")]
    {
        assert_eq!(tag(&METER.replace("°C", written), "D1.T").unit, unit, "{written}");
    }
}

#[test]
fn a_power_of_ten_is_read_with_its_values() {
    let map = "[[tag]]\nname = \"W\"\ntable = \"holding\"\naddress = 40083\ntype = \"int16\"\npoll = \"fast\"\n\
               scale_from = \"W_SF\"\nbad_if = \"sunspec\"\n\
               [[tag]]\nname = \"W_SF\"\ntable = \"holding\"\naddress = 40084\ntype = \"int16\"\npoll = \"once\"\n\
               bad_if = \"sunspec\"\n";
    let map = meter(map).replacen("vendor", "address_base = 0\nvendor", 1);
    let (value, power) = (tag(&map, "D1.W"), tag(&map, "D1.W_SF"));
    assert_eq!(value.decimals, Decimals::PowerFrom(power.id));
    assert_eq!(power.poll, value.poll, "in the same cycle");
    assert!(value.is_bad(Exact::whole(-32_768)) && power.is_bad(Exact::whole(-32_768)));
    let both = map.replace("bad_if = \"sunspec\"\n[[", "decimals_from = \"W_SF\"\n[[");
    assert!(errors(&both).contains("`decimals_from` and `scale_from`"), "{}", errors(&both));
    let shown = map.replace("bad_if = \"sunspec\"\n[[", "decimals = 1\n[[");
    assert!(errors(&shown).contains("`decimals` and `scale_from`"), "{}", errors(&shown));
    let unknown = map.replace("= \"sunspec\"", "= \"solar\"");
    assert!(errors(&unknown).contains("`solar` stands for no raw numbers"), "{}", errors(&unknown));
}
