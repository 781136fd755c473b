//! Walks over simulated registers: where the marker is, how models follow one another, and that every walk ends.

use std::collections::BTreeMap;

use super::*;

/// Registers of a unit; gives its walk, and what was asked.
fn walked(registers: &BTreeMap<(Table, u16), u16>) -> (Walk, Vec<AddressSpan>) {
    walked_through(registers, |_, _| false)
}

/// The same where reads are lost, by their number and span.
fn walked_through(
    registers: &BTreeMap<(Table, u16), u16>,
    is_lost: impl Fn(usize, AddressSpan) -> bool,
) -> (Walk, Vec<AddressSpan>) {
    let (mut walk, mut asked, mut reads) = (Walk::default(), Vec::new(), 0);
    while let Some(spans) = walk.next() {
        assert!(!spans.is_empty() && asked.len() < 2_000, "a walk ends");
        let lost: Vec<AddressSpan> = spans.iter().copied().filter(|span| is_lost(reads, *span)).collect();
        walk.on_outcomes(&|table, address| match registers.get(&(table, to_u16(address))) {
            _ if lost.iter().any(|span| span.table == table && span.range().contains(&address)) => Outcome::Lost,
            Some(word) => Outcome::Word(*word),
            None => Outcome::Refused,
        });
        (reads, asked) = (reads + 1, [asked, spans].concat());
    }
    (walk, asked)
}

/// The marker and these models, each of whose registers holds its place, then the end.
fn unit(table: Table, base: u16, models: &[(u16, u16)]) -> BTreeMap<(Table, u16), u16> {
    let mut words = MARKER.to_vec();
    for (id, length) in models {
        words.extend([*id, *length]);
        words.extend(0..*length);
    }
    words.extend([END, 0]);
    (base..).zip(words).map(|(address, word)| ((table, address), word)).collect()
}

#[test]
fn models_are_found_at_every_usual_place() {
    for table in [Table::Holding, Table::Input] {
        for base in BASES {
            let (walk, asked) = walked(&unit(table, base, &[(1, 66), (103, 50), (64_999, 0), (160, 300)]));
            let found = walk.found().expect("models");
            let heads: Vec<(u16, u16, u16)> =
                found.models.iter().map(|found| (found.id, found.address - base, found.length)).collect();
            assert_eq!(heads, [(1, 4, 66), (103, 72, 50), (64_999, 124, 0), (160, 126, 300)], "{table:?} {base}");
            assert_eq!((found.table, found.base, found.is_cut), (table, base, false));
            assert_eq!(found.models[3].words, (0..300).map(Some).collect::<Vec<_>>());
            assert!(asked.iter().all(|span| span.count <= 125), "{asked:?}");
        }
    }
}

#[test]
fn a_unit_without_models_costs_six_registers() {
    let (walk, asked) = walked(&BTreeMap::new());
    assert_eq!((walk.found(), asked.len()), (None, 6));
    assert!(asked.iter().all(|span| span.count == 1), "a refusal is not read again in halves");
    let (walk, _) = walked(&BTreeMap::from([((Table::Holding, 0), MARKER[0]), ((Table::Holding, 1), 7)]));
    assert_eq!(walk.found(), None);
    let mut both = unit(Table::Holding, 50_000, &[(1, 66)]);
    both.insert((Table::Holding, 0), MARKER[0]);
    assert_eq!(walked(&both).0.found().map(|found| found.base), Some(50_000), "half a marker is none");
}

#[test]
fn a_walk_that_breaks_off_keeps_what_it_has() {
    let whole = unit(Table::Holding, 40_000, &[(1, 66), (103, 50)]);
    let cut = |address: u16| {
        let mut cut = whole.clone();
        cut.retain(|(_, at), _| *at < address);
        let (walk, _) = walked(&cut);
        walk.found().map(|found| (found.models.len(), found.is_cut))
    };
    assert_eq!(cut(40_123), Some((2, false)), "some end with one register");
    assert_eq!(cut(40_122), Some((2, true)));
    assert_eq!(cut(40_070), Some((1, true)));
    assert_eq!(cut(40_002), None);
}

#[test]
fn every_walk_ends_whatever_a_unit_says() {
    let same = |word: u16| -> BTreeMap<(Table, u16), u16> {
        let mut all: BTreeMap<(Table, u16), u16> =
            (0..=u16::MAX).map(|address| ((Table::Holding, address), word)).collect();
        all.extend([((Table::Holding, 40_000), MARKER[0]), ((Table::Holding, 40_001), MARKER[1])]);
        all
    };
    for word in [0, 1, 2, 100, 0x5375, 25_000, 65_534, END] {
        let (walk, _) = walked(&same(word));
        let read = walk.found().map_or(0, |found| found.models.iter().map(|found| found.words.len()).sum());
        assert!(read <= 17_000, "{word}: {read}");
    }
}

#[test]
fn one_lost_request_costs_no_model() {
    let unit = unit(Table::Holding, 40_000, &[(1, 66), (103, 50), (160, 300)]);
    let (whole, _) = walked(&unit);
    for read in 0..6 {
        let (walk, _) = walked_through(&unit, |n, _| n == read);
        assert_eq!(walk.found(), whole.found(), "the {read}th read is lost");
        let (walk, _) = walked_through(&unit, |n, span| n == read && span.address == 40_124);
        assert_eq!(walk.found(), whole.found(), "a head is lost in the {read}th read");
        let (walk, _) = walked_through(&unit, |n, _| n == read || n == read + 1);
        assert_eq!(walk.found(), whole.found(), "the {read}th read and the next are lost");
    }
}

#[test]
fn a_walk_whose_requests_are_lost_again_and_again_says_so() {
    let unit = unit(Table::Holding, 40_000, &[(1, 66), (103, 50), (160, 300)]);
    let (walk, asked) = walked_through(&unit, |_, span| span.address == 40_072);
    let found = walk.found().expect("models");
    assert!(found.is_cut && found.models.len() == 3, "{found:?}");
    assert!(found.models[1].words == vec![None; 50] && found.models[2].words.iter().all(Option::is_some));
    assert_eq!(asked.iter().filter(|span| span.address == 40_072).count(), 3);
    let (walk, asked) = walked_through(&unit, |read, _| 1 < read);
    let found = walk.found().expect("models");
    assert!(found.is_cut && found.models.len() == 1, "{found:?}");
    assert!(asked.len() < 20, "a unit that has fallen silent is not asked again and again: {}", asked.len());
}

#[test]
fn models_may_fill_the_addresses_to_the_last() {
    // Marker and head take 4 registers.
    for (length, behind, expect) in [
        (15_532, vec![], (1, false)),
        (15_531, vec![END], (1, false)),
        (15_531, vec![7], (1, true)),
        (15_530, vec![END, 0], (1, false)),
        (15_530, vec![7, 0], (2, false)),
        (15_530, vec![7, 1], (1, true)),
    ] {
        let mut unit = unit(Table::Holding, 50_000, &[(64_999, length)]);
        unit.retain(|(_, address), _| u32::from(*address) < 50_004 + u32::from(length));
        let behind_it = (50_004 + u32::from(length)..).zip(&behind);
        unit.extend(behind_it.map(|(address, word)| ((Table::Holding, to_u16(address)), *word)));
        let (walk, _) = walked(&unit);
        let found = walk.found().map(|found| (found.models.len(), found.is_cut));
        assert_eq!(found, Some(expect), "{length} and {behind:?}");
    }
}
