//! What a number may be: outside it there is no value, or nothing is written.

use super::super::{unsaid, wrong};
use crate::{
    plant::{exact::Exact, raw_number::BadSpan, scale, tag::Access},
    register_map::{container::node::Node, named::Named},
};

/// Numbers outside `range`, as they stand in the registers without a sign or a mask, and outside `validation`, as values,
/// are none there.
pub(super) fn without_value(item: &Node, named: Named) -> Result<Named, String> {
    let mut bad = Vec::new();
    if let Some(range) = item.get("range") {
        let [least, most] = ["min", "max"].map(|key| whole_of(range, key));
        bad = named.point().outside(least?, most?);
        // Of the other bits of its registers a field knows nothing.
        if named.field.is_some() && !bad.is_empty() {
            return Err(unsaid("range"));
        }
    }
    // What has a name is not checked.
    if let Some(valid) = item.get("validation").filter(|_| named.enum_labels.is_empty() && named.bit_labels.is_empty())
    {
        let [least, most] = ["min", "max"].map(|key| one_of(valid, key, Node::number));
        bad.extend(beyond(&named, least?, most?));
    }
    Ok(Named { bad_if: bad, ..named })
}

/// A number of a key; `None` also where each model has its own, and it is not said which is meant.
fn one_of<N>(limits: &Node, key: &str, number: fn(&Node) -> Option<N>) -> Result<Option<N>, String> {
    let node = limits.get(key).filter(|node| node.text().is_some());
    node.map(|node| number(node).ok_or_else(|| wrong(key, node))).transpose()
}

fn whole_of(limits: &Node, key: &str) -> Result<Option<i128>, String> {
    one_of(limits, key, Node::whole).map(|number| number.map(i128::from))
}

/// The raw numbers whose values are outside these.
fn beyond(named: &Named, least: Option<f64>, most: Option<f64>) -> Vec<BadSpan> {
    let Some((low, high)) = named.point().raw_range() else { return Vec::new() };
    let value = |raw: i128| scale::scaled(Exact::whole(raw), named.scale, named.offset, 0);
    let is_below = |raw: i128| least.is_some_and(|least| value(raw) < least);
    let is_above = |raw: i128| most.is_some_and(|most| Exact::from(most) < value(raw));
    // The values rise with the raw numbers, or fall.
    let (first, last) = if named.scale < 0.0 {
        (first_where(low, high, |raw| !is_above(raw)), first_where(low, high, is_below))
    } else {
        (first_where(low, high, |raw| !is_below(raw)), first_where(low, high, is_above))
    };
    let spans = [(low, first - 1), (last, high)].into_iter().filter(|(first, last)| first <= last);
    spans.map(|(first, last)| BadSpan { first: Exact::whole(first), last: Exact::whole(last) }).collect()
}

/// The lowest number from which on it is so; beyond the highest where it never is.
fn first_where(low: i128, high: i128, is_so: impl Fn(i128) -> bool) -> i128 {
    let (mut low, mut high) = (low, high + 1);
    while low < high {
        let middle = low + (high - low) / 2;
        if is_so(middle) { high = middle } else { low = middle + 1 }
    }
    low
}

/// The limits of what is set are those of the value; where none are stated, those of its raw numbers.
pub(super) fn with_limits(item: &Node, named: Named) -> Named {
    let stated = |key: &str| item.get(key).filter(|limits| limits.get("min").or(limits.get("max")).is_some());
    let is_value = stated("configurable").is_some();
    let limits = stated("configurable").or(stated("range").filter(|_| named.enum_labels.is_empty()));
    let limits = limits.filter(|_| named.access == Access::ReadWrite);
    let is_open = |key: &str| limits.and_then(|limits| limits.get(key)).is_some_and(|node| node.text().is_none());
    if is_open("min") || is_open("max") {
        return Named { access: Access::Read, ..named };
    }
    let of_raw = |raw: f64| if is_value { raw } else { scale::scaled(raw.into(), named.scale, named.offset, 0).near() };
    let limit = |key: &str| limits.and_then(|limits| limits.get(key)).and_then(Node::number).map(of_raw);
    let (min, max) = if !is_value && named.scale < 0.0 { ("max", "min") } else { ("min", "max") };
    Named { min: limit(min), max: limit(max), ..named }
}
