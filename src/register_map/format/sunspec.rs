//! A model of SunSpec: <https://github.com/sunspec/models>. Its points have no address of their own: they follow each other
//! from where the device has the model.

use std::collections::HashMap;

use super::{missing, unsaid, wrong};
use crate::{
    plant::{
        number::{to_u8, to_u16},
        tag::{Access, ByteOrder, DataType, Table},
    },
    profile::{
        sunspec::{self, Kind},
        sunspec_marker, unit_of,
    },
    register_map::{
        container::node::{Node, Tree},
        list::{List, ListContext, words::power_of_ten},
        named::{Named, Repeat},
    },
    t,
};

/// Where the common model begins behind `SunS` at 40000, and the first one behind it.
const COMMON: u16 = 40_002;
const FIRST: u16 = 40_070;

/// Most parts of one kind that are taken of which the device says how many it has.
const REPEATS_MAX: u16 = 16;

/// Where the points of a group stand.
struct Reader<'a> {
    list: &'a mut List,
    context: &'a ListContext,
    /// The register of the next point.
    next: u32,
}

/// The scale factors in sight: of the group and those around it.
type Factors = HashMap<String, u16>;

/// Reads a model; of a repeated group whose number only the device knows the first is read, see [`Repeat`].
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let Some(group) = tree.root.get("group") else { return List::refused(missing("group")) };
    let id = tree.root.get("id").and_then(Node::whole).unwrap_or(0);
    let start = context.start.unwrap_or(if id == 1 { COMMON } else { FIRST });
    list.about = ["SunSpec".to_owned(), format!("{id} {}", group.word("label").unwrap_or_default())];
    if context.start.is_none() {
        let (from, note) = (start, "--start");
        list.warnings.push(t!(
            "the model is taken from register {from}: a device may have it elsewhere ({note})",
            from,
            note
        ));
    }
    let mut reader = Reader { list: &mut list, context, next: u32::from(start) };
    reader.group(group, "", &Factors::new());
    list
}

impl Reader<'_> {
    fn group(&mut self, group: &Node, prefix: &str, outer: &Factors) {
        let mut factors = outer.clone();
        let mut places = HashMap::new();
        let start = self.next;
        let mut at = self.next;
        for point in group.all("points") {
            if let (Some("sunssf"), Some(name), Ok(at)) = (point.word("type"), point.word("name"), u16::try_from(at)) {
                factors.insert(name.to_owned(), at);
            }
            if let (Some(name), Ok(at)) = (point.word("name"), u16::try_from(at)) {
                places.insert(name.to_owned(), u32::from(at));
            }
            at += size_of(point);
        }
        for point in group.all("points") {
            let at = self.next;
            self.next += size_of(point);
            // What only fills a place has no value.
            if point.word("type") == Some("pad") {
                continue;
            }
            let named = point_of(point, prefix, at, &factors).map(|named| Named { line: point.line, ..named });
            let name = point.word("name").unwrap_or("?");
            let named = named.map_err(|why| format!("{prefix}{name}: {why}"));
            self.list.push_of(self.context, None, point.line, named);
        }
        for inner in group.all("groups") {
            let name = inner.word("name").unwrap_or_default();
            let count = inner.get("count").map(Node::shown);
            let times = count.as_deref().map_or(Some(1), |count| count.parse::<u32>().ok());
            let (count, times) = (count.unwrap_or_default(), times.filter(|times| (1..=200).contains(times)));
            let (first, begun) = (self.list.named.len(), self.next);
            for n in 1..=times.unwrap_or(1) {
                let number = if inner.get("count").is_some() { n.to_string() } else { String::new() };
                self.group(inner, &format!("{prefix}{name}{number}."), &factors);
            }
            let is_last = std::ptr::eq(inner, group.all("groups").last().unwrap_or(inner));
            if times.is_none() {
                let is_by_length = count == "0" && prefix.is_empty() && is_last;
                let counted_by = match places.get(&*count) {
                    Some(at) => Some((*at, None)),
                    // Its own number and length are no part of the length.
                    None => is_by_length.then(|| (start + 1, Some(begun - start - 2))),
                };
                let counted_by = counted_by.filter(|_| !has_open_part(inner));
                let most = counted_by
                    .map_or(1, |counted_by| self.repeat(first, begun, &format!("{prefix}{name}"), counted_by));
                self.list.warnings.push(t!(
                    "line {line}: only the device knows how many `{name}` it has ({count}): at most {most} are taken",
                    line = inner.line,
                    name,
                    count,
                    most
                ));
            }
            // Where the next group stands depends on how many these are.
            if times.is_none() && !is_last {
                self.list.warnings.push(t!(
                    "line {line}: what follows `{name}` has no fixed address",
                    line = inner.line,
                    name
                ));
                return;
            }
        }
    }
}

impl Reader<'_> {
    /// What was read since is the first of several; how many of them are taken.
    fn repeat(&mut self, first: usize, begun: u32, prefix: &str, (counted_at, fixed): (u32, Option<u32>)) -> u16 {
        let step = self.next - begun;
        let most =
            (0x1_0000_u32.saturating_sub(begun)).checked_div(step).map_or(1, |most| most.min(REPEATS_MAX.into()));
        // Of what stands beyond the last register its address has said so.
        let counted_by = (to_u16(counted_at), fixed.map(to_u16));
        let repeat = Repeat { prefix: prefix.to_owned(), step: to_u16(step), count: to_u16(most), counted_by };
        for named in self.list.named.iter_mut().skip(first).filter(|_| 1 < most) {
            named.repeat = Some(repeat.clone());
        }
        repeat.count
    }
}

/// Has a group parts of which only the device knows how many there are?
fn has_open_part(group: &Node) -> bool {
    group.all("groups").iter().any(|part| {
        let is_fixed = part.get("count").is_none_or(|count| count.whole().is_some_and(|count| 0 < count));
        !is_fixed || has_open_part(part)
    })
}

fn size_of(point: &Node) -> u32 {
    point.get("size").and_then(Node::whole).and_then(|size| u32::try_from(size).ok()).unwrap_or(0)
}

fn point_of(point: &Node, prefix: &str, at: u32, factors: &Factors) -> Result<Named, String> {
    let name = point.word("name").ok_or_else(|| missing("name"))?;
    let address = u16::try_from(at).map_err(|_| unsaid("size"))?;
    let word = point.word("type").ok_or_else(|| missing("type"))?;
    let size = point.opt_whole("size")?.ok_or_else(|| missing("size"))?;
    let (kind, bad) = kind_of(word, size)?;
    let name = format!("{prefix}{name}");
    let access = if point.word("access") == Some("RW") { Access::ReadWrite } else { Access::Read };
    let named = Named { access, ..Named::new(Table::Holding, address, kind, ByteOrder::Abcd, &name) };
    if kind.is_text() {
        return Ok(named.with_text_access());
    }
    let bad = bad.and_then(|pattern| named.point().raw_number(pattern, true).number());
    let mut named = Named { bad_if: bad.into_iter().map(Into::into).collect(), ..named };
    named.unit = unit_of(point.word("units").unwrap_or_default());
    if let Some(node) = point.get("sf") {
        match (node.whole(), node.text().and_then(|name| factors.get(name))) {
            (Some(power), _) => {
                let power = i8::try_from(power)
                    .ok()
                    .filter(|power| (-10..=10).contains(power))
                    .ok_or_else(|| wrong("sf", node))?;
                named = named.scaled(power_of_ten(f64::from(power)), 0.0);
            }
            (None, Some(at)) => named.power_at = Some(*at),
            (None, None) => return Err(wrong("sf", node)),
        }
    } else if word.starts_with("float") {
        named.decimals = 2;
    }
    symbols(point, word, named)
}

/// Names of numbers, or of bits.
fn symbols(point: &Node, word: &str, mut named: Named) -> Result<Named, String> {
    let mut labels = Vec::new();
    for symbol in point.all("symbols") {
        let node = symbol.get("value").ok_or_else(|| missing("value"))?;
        let value = node.whole().ok_or_else(|| wrong("value", node))?;
        labels.push((i128::from(value), symbol.word("label").or(symbol.word("name")).unwrap_or_default().to_owned()));
    }
    if !word.starts_with("bitfield") {
        return Ok(named.labelled(labels));
    }
    for (bit, label) in labels {
        let bit = u8::try_from(bit).ok().filter(|bit| *bit < named.kind.bits()).ok_or_else(|| unsaid("symbols"))?;
        named.bit_labels.push((bit, label));
    }
    Ok(named)
}

/// The type, and the pattern that says that a device does not have the point; both as for a device that is walked.
fn kind_of(word: &str, size: i64) -> Result<(DataType, Option<i128>), String> {
    if word == "string" && !(1..=125).contains(&size) {
        return Err(unsaid("size"));
    }
    let kind = if word == "string" { Kind::Text } else { sunspec::kind_of(word).0 };
    Ok(match kind {
        Kind::Number(kind) | Kind::Enum(kind) | Kind::Bits(kind) => (kind, sunspec_marker(kind)),
        Kind::NotZero(kind) => (kind, Some(0)),
        Kind::Address(address) => (DataType::NetworkAddress(address), None),
        Kind::Power => (DataType::I16, sunspec_marker(DataType::I16)),
        Kind::Text => (DataType::TextToNul(to_u8(2 * size)), None),
        Kind::Pad => return Err(t!("`{word}` is not a known type", word)),
    })
}
