//! Lists of ioBroker, as that program reads them.

use super::doubtful::check;

const HEADING: &str =
    "_address\tname\tdescription\tunit\ttype\tlen\tfactor\toffset\tformula\trole\troom\tpoll\twp\tcw\tisScale\n";

/// Rows of address, name, unit, type, length, factor, offset and formula.
fn list(rows: &[&str]) -> String {
    let row = |row: &&str| {
        let cells: Vec<&str> = row.split(' ').collect();
        format!("{}\t{}\t\t{}\n", cells[0], cells[1], cells[2..].join("\t").replace('_', " "))
    };
    format!("{HEADING}{}", rows.iter().map(row).collect::<String>())
}

#[test]
fn iobroker_takes_0_for_1_and_lengths_of_texts_alone() {
    let text = list(&[
        "100 a V uint16be 1 0 0",
        "101 b V uint32be 4 0,1 0",
        "103 c V uint16be 2  ",
        "104 d V uint32sb 2 1 0",
        "106 e  string 3 1 0",
    ]);
    let taken = [
        "40101 a uint16 ABCD x1 V",
        "40102 b uint32 ABCD x0.1 V",
        "40104 c uint16 ABCD x1 V",
        "40105 d uint32 BADC x1 V",
        "40107 e string(6) ABCD x1",
    ];
    check(&text, &taken, &[], &[]);
}

#[test]
fn iobroker_formulas_that_only_scale_are_taken() {
    let text = list(&[
        "100 a V int16be 1 1 0 x_*_Math.pow(10,_sf['105'])",
        "101 b V int16be 1 1 0 x*Math.pow(10,-3)",
        "102 c V int16be 1 1 0 x_*_2_*_0.01",
        "103 d V int16be 1 1 0 x/50",
        "104 e V int16be 1 1 0 x<0?0:x",
        "105 sf  int16be 1 1 0",
        "106 f V int16be 1 0,1 0 x/10",
        "107 g V int16be 1 1 0 x*x",
        "108 h V int16be 1 1 0 x*Math.pow(10,sf['200'])",
    ]);
    let taken = [
        "40101 a int16 ABCD x1 V ^105",
        "40102 b int16 ABCD x0.001 V",
        "40103 c int16 ABCD x0.02 V",
        "40104 d int16 ABCD x0.02 V",
        "40106 sf int16 ABCD x1",
        "40109 h int16 ABCD x1 V ^200",
    ];
    check(&text, &taken, &["104: the formula", "106: the formula", "107: the formula"], &[]);
}

#[test]
fn iobroker_numbers_of_registers_are_never_those_of_bits() {
    let text = list(&["10400 a V uint16be 1 1 0", "40010 b V uint16be 1 1 0"]);
    check(&text, &["410401 a uint16 ABCD x1 V", "440011 b uint16 ABCD x1 V"], &[], &[]);
    let aliased = list(&[
        "40001 a V uint16be 1 1 0",
        "97601 b V uint16be 1 1 0 x*Math.pow(10,sf['97602'])",
        "97602 sf  int16be 1 1 0",
        "101697 c V uint16be 1 1 0",
    ]);
    let taken = [
        "40001 a uint16 ABCD x1 V",
        "457601 b uint16 ABCD x1 V ^57601",
        "457602 sf int16 ABCD x1",
        "461697 c uint16 ABCD x1 V",
    ];
    check(&aliased, &taken, &[], &[]);
    let odd = list(&["100 a V uint16be 1 1 0", "97601 b V uint16be 1 1 0"]);
    check(&odd, &["40101 a uint16 ABCD x1 V"], &["`97601` is not an address"], &[]);
}
