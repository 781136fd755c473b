//! Lists of manuals and of other programs, with what is taken of them and what is not.

use super::*;

fn context() -> ListContext {
    ListContext { unit: Some(1), ..ListContext::default() }
}

fn shown(list: &List) -> Vec<String> {
    let shown = |named: &Named| {
        let (place, kind, order) = (named.table.modicon(named.address), named.kind, named.order.word());
        let offset = if named.offset == 0.0 { String::new() } else { format!(" {:+}", named.offset) };
        format!("{place} {} {kind} {order} {}{offset} {} {}", named.name, named.scale, named.decimals, named.unit)
    };
    list.named.iter().map(shown).collect()
}

fn read(text: &str) -> (Vec<String>, Vec<String>) {
    let list = parse(text, &context());
    (shown(&list), list.problems)
}

#[test]
fn a_csv_with_a_heading_is_read_in_any_order_of_columns() {
    let csv = "Name;Unit;Register Address;Data type;Scaling\n\"SV; wanted\";degC;41003;INT16;0,1\n\nEnergy;kWh;31001;float32;\n";
    let expect = ["41003 SV; wanted int16 ABCD 0.1 1 °C", "31001 Energy float32 ABCD 1 2 kWh"];
    assert_eq!(read(csv), (expect.map(str::to_owned).to_vec(), Vec::new()));
    let fc = "address,name,function code,type,divisor\n0x0010,Speed,04,u16,10\n12,Run,1,,\n";
    assert_eq!(read(fc).0, ["30017 Speed uint16 ABCD 0.1 1 ", "00013 Run bool ABCD 1 0 "]);
}

#[test]
fn columns_of_a_pdf_are_known_by_their_form() {
    let columns = "Modbus map, page 7\n40001   Voltage L1   float  V\n40003   Power factor   int16   0.001\n";
    let (named, problems) = read(columns);
    assert_eq!(named, ["40001 Voltage L1 float32 ABCD 1 2 V", "40003 Power factor int16 ABCD 0.001 3 "]);
    assert_eq!(problems, ["line 1: no address"]);
    assert_eq!(read("1 40010 Tank level UINT16 /10 cm CDAB\n").0, ["40010 Tank level uint16 CDAB 0.1 1 cm"]);
    assert_eq!(read("40010 Run hours in test h\n").0, ["40010 Run hours in test uint16 ABCD 1 0 h"]);
    assert_eq!(read("2025-11-15 built\n"), (Vec::new(), Vec::new()), "a date is no address");
    assert_eq!(
        read("0x03EA SV x0.1 °C\n03EBH STBY\n").0,
        ["41003 SV uint16 ABCD 0.1 1 °C", "41004 STBY uint16 ABCD 1 0 "]
    );
}

#[test]
fn what_cannot_be_read_is_said_by_line() {
    let (named, problems) =
        read("address,name,type,scale\n5,a,int16,1\n5,b,int16,1\nx,c,int16,1\n6,d,quux,1\n7,,int16,1\n8,e,int16,ten\n");
    assert_eq!(named, ["40006 a int16 ABCD 1 0 "]);
    let expect = [
        "line 3: b: this address has a name already",
        "line 4: `x` is not an address",
        "line 5: 6: `quux` is not a known type",
        "line 6: 7: no name",
        "line 7: 8: `ten` is not a scale",
    ];
    assert_eq!(problems, expect);
}

#[test]
fn plain_numbers_count_from_one_where_the_manual_does() {
    let list =
        parse("1  first\n0  none\n", &ListContext { table: Table::Input, base: Some(AddressBase::One), ..context() });
    assert_eq!((list.named[0].table, list.named[0].address, list.named.len()), (Table::Input, 0, 1));
    assert_eq!(list.problems, ["line 2: `0` is not an address"]);
}

#[test]
fn a_division_factor_divides_and_a_size_is_a_type() {
    assert_eq!(read("Address,Name,Division factor,Unit\n1,Outdoor,10,°C\n").0, ["40002 Outdoor uint16 ABCD 0.1 1 °C"]);
    let pump = "Title;Register type;Register;Division factor;Unit;Size of variable;Min value;Max value;Default value\n\
                Outdoor;MODBUS_INPUT_REGISTER;1;10;°C;s16;0;0;0\n\
                Starts;MODBUS_INPUT_REGISTER;1046;1;;u32;0;0;0\n\
                Mode;MODBUS_HOLDING_REGISTER;237;1;;u8;0;2;0\n\
                Curve;MODBUS_HOLDING_REGISTER;26;1;;s8;0;15;9\n\
                Offset;MODBUS_HOLDING_REGISTER;30;10;°C;s16;-100;100;0\n";
    let (named, problems) = read(pump);
    let expect = [
        "30002 Outdoor int16 ABCD 0.1 1 °C",
        "31047 Starts uint32 CDAB 1 0 ",
        "40027 Curve int8 ABCD 1 0 ",
        "40031 Offset int16 ABCD 0.1 1 °C",
        "40238 Mode uint8 ABCD 1 0 ",
    ];
    assert_eq!(named.iter().map(String::as_str).collect::<std::collections::BTreeSet<_>>(), expect.into());
    assert!(problems.is_empty(), "{problems:?}");
}

#[test]
fn of_two_addresses_the_surest_counts() {
    let (named, _) = read("Register,Address (hex),Name\n40017,0010,a\n40018,0011,b\n");
    assert_eq!(named, ["40017 a uint16 ABCD 1 0 ", "40018 b uint16 ABCD 1 0 "], "below hex digits are hexadecimal");
    assert_eq!(read("Register number,Wire,Name\n5,4,a\n").0, ["40005 a uint16 ABCD 1 0 "]);
}

#[test]
fn a_stated_table_decides_what_five_digits_mean() {
    let (named, _) = read("address,name,type,table\n16299,a,int16,holding\n40001,b,int16,holding\n");
    assert_eq!(named, ["416300 a int16 ABCD 1 0 ", "440002 b int16 ABCD 1 0 "]);
    let zero = ListContext { base: Some(AddressBase::Zero), ..context() };
    let list = parse("address,name,type\n40080,W,int16\nholding:32080,P,int32\n400001,first,int16\n", &zero);
    assert_eq!(shown(&list), ["440081 W int16 ABCD 1 0 ", "432081 P int32 ABCD 1 0 ", "40001 first int16 ABCD 1 0 "]);
}

#[test]
fn digits_of_two_registers_are_asked_about_once() {
    let sunspec = "address,name,type\n40080,W,int16\n40083,VA,int16\n";
    let list = parse(sunspec, &context());
    let readings = [(AddressBase::Modicon, (Table::Holding, 79)), (AddressBase::Zero, (Table::Holding, 40_080))];
    let both = Unclear { written: "40080".into(), readings };
    assert_eq!(list.unclear, Some(both));
    for (base, first) in [(AddressBase::Modicon, 79), (AddressBase::Zero, 40_080), (AddressBase::One, 40_079)] {
        let list = parse(sunspec, &ListContext { base: Some(base), ..context() });
        assert_eq!((list.unclear, list.named[0].address), (None, first));
    }
    let six = parse("address,name,type\n40080,W,int16\n412000,E,int16\n", &context());
    assert_eq!((six.unclear, six.named[0].address), (None, 79));
    assert_eq!(parse("address,name\n1002,SV\n0x9C41,PV\n", &context()).unclear, None);
}

#[test]
fn a_list_of_iobroker_is_read_with_types_orders_and_units() {
    let list = "_address\tdeviceId\tname\tdescription\tunit\ttype\tlen\tfactor\toffset\tformula\trole\troom\tpoll\twp\tcw\tisScale\n\
                100\t1\tTemp\toutside\tC\tint16be\t1\t0,1\t-40\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                101\t1\tEnergy\t\tKWH\tuint32sw\t2\t0,01\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                103\t1\tSerial\t\t\tstring\t4\t1\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                110\t1\tPower\t\tW\tint16be\t1\t1\t0\tx * Math.pow(10, sf['111'])\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                112\t2\tOther\t\tW\tint16be\t1\t1\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                113\t1\tSwapped\t\tW\tint32sb\t2\t1\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n\
                115\t1\tWide\t\tW\tint16be\t2\t1\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n";
    let (named, problems) = read(list);
    let expect = [
        "40101 Temp int16 ABCD 0.1 -40 1 °C",
        "40102 Energy uint32 CDAB 0.01 2 kWh",
        "40104 Serial string(8) ABCD 1 0 ",
        "40111 Power int16 ABCD 1 0 W",
        "40114 Swapped int32 BADC 1 0 W",
        "40116 Wide int16 ABCD 1 0 W",
    ];
    assert_eq!(named, expect);
    let expect = ["to unit 2"];
    assert_eq!(problems.len(), expect.len(), "{problems:?}");
    for (problem, expect) in problems.iter().zip(expect) {
        assert!(problem.contains(expect), "{problem}: {expect}");
    }
}

#[test]
fn a_power_of_ten_is_never_taken_for_a_factor() {
    let (named, problems) = read("address,name,type,scale factor\n1,a,int16,-1\n2,b,int16,1\n3,c,int16,\n");
    assert_eq!(named, ["40004 c int16 ABCD 1 0 "]);
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(problems[1].contains("factor / power of ten?"), "{problems:?}");
    let (named, problems) = read("address,name,type,SF\n1,W,int16,W_SF\n2,a,int16,V_SF\n");
    assert!(named.is_empty() && problems[0].contains("`W_SF` is not a scale"), "{named:?} {problems:?}");
    assert_eq!(
        read("address,name,type,SF\n1,W,int16,-1\n2,b,int16,2\n").0,
        ["40002 W int16 ABCD 0.1 1 ", "40003 b int16 ABCD 100 0 "]
    );
    let said = ListContext { means: Said::from([("Scale Factor".to_owned(), Some(Column::Scale))]), ..context() };
    let list = parse("address,name,type,scale factor\n1,a,int16,-1\n", &said);
    assert_eq!(list.named[0].scale, -1.0, "as its reader has said");
}

#[test]
fn a_table_of_something_else_is_refused_as_a_whole() {
    for (text, expect) in [
        ("Mode\tCode\tDescription\nWait\t0\tcut off\nOn\t1\tconnected\n", "Mode, Code, Description"),
        ("Hex\tCode\tDescription\n0x01\t1\tno battery\n", "Hex, Code, Description"),
        ("Bit Number\tError message\n0\tGFCI\n1\tRelay\n", "no column of addresses"),
        ("parameters:\n  - name: PV\n    registers: [0x022D]\n    scale: 0.1\n", "only 0 of its 4 lines"),
        ("", "it is empty"),
    ] {
        let list = parse(text, &context());
        assert!(
            list.named.is_empty() && list.refused.as_ref().is_some_and(|why| why.contains(expect)),
            "{text}: {list:?}"
        );
    }
}
