//! A value and the power of ten that scales it come in one answer, where one request can hold both: only then are they
//! certainly of the same instant.

use super::{Extent, UnreadableRanges, end_of};
use crate::plant::{
    def::{DeviceDef, TagId},
    tag::TagDef,
};

/// Joins the requests of a value and of its power of ten with all that lie between them. The registers between are read along,
/// however many they are.
pub(super) fn join<'a>(
    mut runs: Vec<Vec<&'a TagDef>>,
    device: &DeviceDef,
    unreadable: &UnreadableRanges,
) -> Vec<Vec<&'a TagDef>> {
    let mut place = 0;
    while let Some(run) = runs.get(place) {
        let sources = run.iter().filter_map(|tag| tag.decimals.power_source());
        let other = sources.filter_map(|source| place_of(&runs, source)).filter(|other| *other != place);
        let ends = other.map(|other| (place.min(other), place.max(other)));
        let mut fitting = ends.filter(|(low, high)| fits(&runs[*low..=*high], device, unreadable));
        match fitting.next() {
            Some((low, high)) => {
                let mut joined: Vec<&TagDef> = runs.drain(low..=high).flatten().collect();
                joined.sort_by_key(|tag| (tag.point.address, tag.point.len(), tag.id));
                runs.insert(low, joined);
                place = low;
            }
            None => place += 1,
        }
    }
    runs
}

fn place_of(runs: &[Vec<&TagDef>], tag: TagId) -> Option<usize> {
    runs.iter().position(|run| run.iter().any(|other| other.id == tag))
}

fn fits(runs: &[Vec<&TagDef>], device: &DeviceDef, unreadable: &UnreadableRanges) -> bool {
    let tags = || runs.iter().flatten();
    let (Some(first), Some(end)) = (runs.first(), tags().map(|tag| end_of(tag.point)).max()) else { return false };
    let extent = Extent::new(first[0].point, end, device);
    extent.allowed(device, unreadable)
}

#[cfg(test)]
mod tests {
    use super::super::blocks;
    use super::*;
    use crate::plant::{
        PlantDef,
        def::LineId,
        fixture::{self, DP, SV},
        tag::Decimals,
    };

    fn requests(def: &PlantDef, unreadable: &UnreadableRanges) -> Vec<(u16, u16)> {
        let all = blocks(def, LineId(0), unreadable);
        all.iter().filter(|block| block.tags.contains(&SV)).map(|block| (block.address, block.count)).collect()
    }

    #[test]
    fn a_value_and_its_power_come_in_one_answer() {
        let mut def = fixture::plant();
        let none = UnreadableRanges::default();
        assert_eq!(requests(&def, &none), [(1002, 1)], "too far apart to be read along");
        def.tags[SV.index()].decimals = Decimals::PowerFrom(DP);
        assert_eq!(requests(&def, &none), [(1002, 18)]);
        def.tags[DP.index()].point.address = 1100;
        assert_eq!(requests(&def, &none), [(1002, 1)], "more than the 60 registers of its requests");
        def.tags[DP.index()].point.address = 1019;
        let mut refused = UnreadableRanges::default();
        refused.add(1, crate::plant::tag::Table::Holding, 1010, 1011);
        assert_eq!(requests(&def, &refused), [(1002, 1)], "a register between them is refused");
    }
}
