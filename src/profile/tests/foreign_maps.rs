//! Maps as the world writes them: addresses beyond 10000, patterns of bits, defaults for registers beside coils and texts.

mod device_alarms;
mod repeats;

use std::time::Duration;

use super::*;
use crate::plant::{
    exact::Exact,
    tag::{DataType, Decimals, Poll, Table, TagDef},
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
    let span = |ends: &str| {
        format!("[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"int16\"\nbad_if = [{ends}]\n")
    };
    let found = tag(&meter(&span("[0x8000, -100], 7")), "D1.X");
    let bad = [-32_768, -100, 7].map(|raw| found.is_bad(Exact::whole(raw)));
    assert_eq!((bad, found.is_bad(Exact::whole(-99))), ([true; 3], false), "{:?}", found.bad_if);
    let refused = errors(&meter(&span("[5, 0x8000]")));
    assert!(refused.contains("begin at 5 and end at -32768"), "{refused}");
    assert!(errors(&meter(&span("[5]"))).contains("the lowest and the highest"));
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
    assert_eq!(bad("D1.A"), [Exact::whole(-32_768).into()]);
    assert_eq!(bad("D1.B"), [Exact::whole(65_535).into()], "0x8000 is a value of this type");
    assert_eq!((bad("D1.C"), bad("D1.S")), (Vec::new(), Vec::new()));
    assert_eq!(warnings(&meter), Vec::<String>::new());
}

#[test]
fn patterns_name_states_probes_and_the_values_of_interlocks() {
    let state = meter(
        "[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"int16\"\nenum = { 0 = \"off\", 0xFFFF = \"on\" }\n\
         [[tag]]\nname = \"Y\"\ntable = \"holding\"\naddress = 2001\ntype = \"int16\"\n\
         [signature]\nprobe = [{ tag = \"X\", is = [0xFFFF, 0] }, { tag = \"X\", is = [1] }, { tag = \"X\", is = [2] }]\n",
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
    for piece in ["[meter.toml:17:17]", "D1.DP may hold a power of ten", "write scale_from instead"] {
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

#[test]
fn a_part_of_a_register_says_how_it_is_written() {
    let map = |keys: &str| {
        meter(&format!("[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 500\naccess = \"rw\"\n{keys}"))
    };
    for keys in ["type = \"uint16\"\nfield = \"7-4\"", "type = \"uint8\"", "type = \"int8\"\norder = \"BADC\""] {
        let refused = errors(&map(keys));
        assert!(refused.contains("cannot be written by a whole word"), "{refused}");
        let written = tag(&map(&format!("{keys}\nwrite = \"rmw\"")), "D1.X");
        assert!(written.read_modify_write && written.write_function() == Some(6), "{keys}");
        let masked = tag(&map(&format!("{keys}\nwrite_fc = 22")), "D1.X");
        assert!(!masked.read_modify_write && masked.write_function() == Some(22), "{keys}");
        let both = errors(&map(&format!("{keys}\nwrite = \"rmw\"\nwrite_fc = 22")));
        assert!(both.contains("function 22 cannot write this tag"), "{both}");
    }
    let whole = errors(&map("type = \"uint16\"\nwrite = \"rmw\""));
    assert!(whole.contains("only a part of a register"), "{whole}");
    let halves = map("type = \"uint8\"\nwrite = \"rmw\"")
        + "[[tag]]\nname = \"Y\"\ntable = \"holding\"\naddress = 500\ntype = \"uint8\"\norder = \"BADC\"\n";
    assert_eq!(tag(&halves, "D1.Y").point.address, 500, "two bytes share a register");
}

#[test]
fn every_type_is_written_in_a_profile_as_it_is_shown() {
    for word in DataType::NUMBERS
        .map(|kind| kind.to_string())
        .into_iter()
        .chain(["chars(5)", "cstring(7)", "epoch32", "clock_bcd"].map(str::to_owned))
    {
        let map = meter(&format!("[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 500\ntype = \"{word}\"\n"));
        assert_eq!(tag(&map, "D1.X").point.kind.to_string(), word);
    }
    for (word, why) in [
        ("chars", "`chars` does not say how long the text is"),
        ("chars(126)", "expected \"chars(N)\" with N registers, 1 to 125"),
        ("mod10k(5)", "unknown type `mod10k(5)`"),
        ("uint12", "unknown type `uint12`"),
    ] {
        let map = meter(&format!("[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 500\ntype = \"{word}\"\n"));
        assert!(errors(&map).contains(why), "{}", errors(&map));
    }
}

#[test]
fn a_tag_may_have_a_poll_period_of_its_own() {
    let map = |poll: &str| {
        meter(&format!(
            "[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 500\ntype = \"int16\"\npoll = \"{poll}\""
        ))
    };
    for (poll, millis) in [("250ms", 250), ("5 min", 300_000), ("1h", 3_600_000)] {
        assert_eq!(tag(&map(poll), "D1.X").poll, Poll::Every(Duration::from_millis(millis)), "{poll}");
    }
    for (poll, why) in
        [("10ms", "this is not a poll period"), ("5 apples", "is not a duration"), ("quick", "unknown poll `quick`")]
    {
        assert!(errors(&map(poll)).contains(why), "{}", errors(&map(poll)));
    }
}

#[test]
fn a_tag_may_be_written_elsewhere_than_it_is_read() {
    let map = |keys: &str| {
        meter(&format!(
            "[[tag]]\nname = \"X\"\ntable = \"input\"\naddress = 500\ntype = \"int16\"\naccess = \"rw\"\n{keys}"
        ))
    };
    assert_eq!(tag(&map("write_address = 0x700"), "D1.X").write_at, Some((Table::Holding, 0x700)));
    assert_eq!(tag(&map("write_address = \"holding:9\"\nwrite_fc = 16"), "D1.X").write_function(), Some(16));
    for (keys, why) in [
        ("", "a input can only be read"),
        ("write_address = \"coil:9\"", "a input cannot be written to a coil"),
        ("write_address = 9\nfield = 3\nwrite = \"rmw\"", "is not what would be written back"),
    ] {
        assert!(errors(&map(keys)).contains(why), "{}", errors(&map(keys)));
    }
    let read = map("write_address = 9").replace("access = \"rw\"\nwrite", "write");
    assert!(errors(&read).contains("it is not written"), "{}", errors(&read));
}

#[test]
fn numbers_of_64_bits_have_names_and_so_have_their_bits() {
    let map = meter(
        "[[tag]]\nname = \"E\"\ntable = \"holding\"\naddress = 500\ntype = \"uint64\"\n\
         enum = { \"0xFFFFFFFFFFFFFFFF\" = \"none\", 9007199254740993 = \"odd\" }\n\
         [[tag]]\nname = \"B\"\ntable = \"holding\"\naddress = 504\ntype = \"uint48\"\nfield = \"47-32\"\nbits = { 15 = \"top\" }\n",
    );
    let named = tag(&map, "D1.E");
    assert_eq!(named.label_of(Exact::whole(u64::MAX.into())), Some("none"));
    let (odd, even) = (Exact::whole(9_007_199_254_740_993), Exact::whole(9_007_199_254_740_992));
    assert_eq!((named.label_of(odd), named.label_of(even)), (Some("odd"), None), "to the last digit");
    assert_eq!(tag(&map, "D1.B").bit_labels, [(15, "top".to_owned())]);
    let beyond = map.replace("bits = { 15", "bits = { 16");
    assert!(errors(&beyond).contains("there is no bit 16"), "{}", errors(&beyond));
}

#[test]
fn a_value_of_32_bits_may_have_one_address() {
    let row = |keys: &str| format!("[[tag]]\nname = \"X\"\naddress = 7001\ntype = \"enron_float32\"\n{keys}\n");
    let map = meter(&row("table = \"holding\"\naccess = \"rw\""));
    let x = tag(&map, "D1.X");
    assert_eq!((x.point.len(), x.point.words(), x.write_function()), (1, 2, Some(16)));
    let next = format!("{}{}", row("table = \"holding\""), row("table = \"holding\"").replace("7001", "7002"));
    let next = meter(&next.replacen("\"X\"", "\"W\"", 1));
    assert_eq!(tag(&next, "D1.W").point.address, 7_001, "the next one begins at the next address");
    for (keys, why) in [
        ("table = \"coil\"", "a coil is one bit"),
        ("table = \"holding\"\naccess = \"rw\"\nwrite_fc = 6", "function 6 cannot write this tag"),
        ("table = \"holding\"\naccess = \"rw\"\nwrite_fc = 23", "expected [16]"),
        ("table = \"holding\"\n[[signature.probe]]\ntag = \"X\"\nis = [1]", "X is not a 16-bit register"),
    ] {
        let map = meter(&row(keys));
        assert!(errors(&map).contains(why), "{keys}: {}", errors(&map));
    }
}
