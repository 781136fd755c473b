//! The delta of a list: new elements, and ranges kept from the list before.

use serde::{Deserialize, Serialize};

use super::DeltaMismatch;
use crate::plant::number::to_u32;

/// How far ahead a kept element is searched for.
const LOOK_AHEAD: usize = 32;

/// A list, as pieces of the list before and new elements; `None`: nothing has changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct List<T>(Option<Vec<Piece<T>>>);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Piece<T> {
    /// So many elements of the list before, from this place on.
    Kept(u32, u32),
    /// New ones.
    New(Vec<T>),
}

impl<T: Clone + PartialEq> List<T> {
    /// Nothing has changed.
    pub fn same() -> List<T> {
        List(None)
    }

    /// What makes `new` of `old`.
    pub fn between(old: &[T], new: &[T]) -> List<T> {
        if old == new {
            return List(None);
        }
        let mut pieces: Vec<Piece<T>> = Vec::new();
        // Where in the old list the next element stands if nothing came or went.
        let mut expected = 0;
        for (place, element) in new.iter().enumerate() {
            let ahead = expected..old.len().min(expected + LOOK_AHEAD);
            let found = std::iter::once(place).chain(ahead).find(|at| old.get(*at) == Some(element));
            match (found, pieces.last_mut()) {
                (Some(at), Some(Piece::Kept(from, count))) if *from as usize + *count as usize == at => *count += 1,
                (Some(at), _) => pieces.push(Piece::Kept(to_u32(at), 1)),
                (None, Some(Piece::New(elements))) => elements.push(element.clone()),
                (None, _) => pieces.push(Piece::New(vec![element.clone()])),
            }
            expected = found.map_or(expected, |at| at + 1);
        }
        List(Some(pieces))
    }

    /// The new list; `None` if it is the old one.
    pub fn made_of(self, old: &[T]) -> Result<Option<Vec<T>>, DeltaMismatch> {
        let Some(pieces) = self.0 else { return Ok(None) };
        let mut made = Vec::new();
        for piece in pieces {
            match piece {
                Piece::Kept(from, count) => {
                    let (from, count) = (from as usize, count as usize);
                    made.extend_from_slice(old.get(from..from.saturating_add(count)).ok_or(DeltaMismatch)?);
                }
                Piece::New(elements) => made.extend(elements),
            }
        }
        Ok(Some(made))
    }

    /// Makes the old list the new one.
    pub fn apply(self, list: &mut Vec<T>) -> Result<(), DeltaMismatch> {
        if let Some(made) = self.made_of(list)? {
            *list = made;
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn any_list_is_made_of_any_other(old in prop::collection::vec(0u8..6, 0..80), new in prop::collection::vec(0u8..6, 0..80)) {
            let mut list = old.clone();
            List::between(&old, &new).apply(&mut list).unwrap();
            prop_assert_eq!(list, new);
        }
    }

    #[test]
    fn one_in_front_one_gone_and_one_changed_cost_one_element_each() {
        let old: Vec<u32> = (0..1_000).collect();
        let news = |new: &[u32]| {
            let List(pieces) = List::between(&old, new);
            let count = |piece: &Piece<u32>| if let Piece::New(elements) = piece { elements.len() } else { 0 };
            pieces.unwrap_or_default().iter().map(count).sum::<usize>()
        };
        let front: Vec<u32> = [5_000].into_iter().chain(0..1_000).collect();
        let gone: Vec<u32> = (0..1_000).filter(|n| *n != 300).collect();
        let changed: Vec<u32> = (0..1_000).map(|n| if n == 300 { 5_000 } else { n }).collect();
        assert_eq!([news(&front), news(&gone), news(&changed), news(&old)], [1, 0, 1, 0]);
    }

    #[test]
    fn pieces_of_another_list_are_found_out() {
        let old: Vec<u32> = (0..10).collect();
        let delta = List::between(&old, &old[1..]);
        assert_eq!(delta.apply(&mut vec![1, 2, 3]), Err(DeltaMismatch));
        assert_eq!(List(Some(vec![Piece::<u8>::Kept(u32::MAX, u32::MAX)])).apply(&mut vec![1]), Err(DeltaMismatch));
    }
}
