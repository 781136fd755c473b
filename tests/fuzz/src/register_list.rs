//! Register maps of other programs and makers: a file is refused with its reason, or becomes a profile that can run, and the
//! profile's own list, read again, is the same registers.

use sightglass::api::{
    plant::{AddressBase, PlantDef, TagDef},
    register_map::{List, ListContext, Target, export, read, written},
};

use super::common::run_plant;

/// The file; with what its plain numbers mean, and without.
pub fn run(data: &[u8]) {
    for base in [None, Some(AddressBase::Zero)] {
        run_with(data, &ListContext { base, ..ListContext::default() });
    }
}

fn run_with(data: &[u8], context: &ListContext) {
    let list = read(data, context);
    if let Some(why) = &list.refused {
        return assert!(!why.is_empty(), "refused without a reason");
    }
    match written(&list, "fuzz", "fuzz") {
        Err(why) => assert!(!why.is_empty(), "no profile without a reason"),
        Ok(profile) => {
            run_plant(&profile.checked.plant);
            comes_back(&profile.checked.plant);
        }
    }
}

fn comes_back(plant: &PlantDef) {
    let exported = export(plant, Target::Csv);
    if exported.count == 0 {
        return;
    }
    let List { refused, problems, named, .. } = read(exported.text.as_bytes(), &ListContext::default());
    assert_eq!((refused, problems), (None, Vec::new()), "{}", exported.text);
    let registers = |tag: &TagDef| (tag.short.clone(), tag.point, tag.scale, tag.offset, tag.bad_if.clone());
    let is_left_out = |tag: &TagDef| exported.left_out.iter().any(|line| line.starts_with(&format!("{}: ", tag.short)));
    let kept: Vec<_> = plant.tags.iter().filter(|tag| !is_left_out(tag)).map(registers).collect();
    let again: Vec<_> = named.iter().map(|named| registers(&named.tag(&named.name))).collect();
    assert_eq!(again, kept, "{}", exported.text);
}
