//! The keys of a tag as they stand in a file.

use toml_edit::Value;

use crate::plant::{
    raw_number::BadSpan,
    tag::{Access, Bound, ByteOrder, Decimals, TagDef},
    visible::visible,
};

/// The keys of a tag, those that are usual left out, as is how often it is read.
pub fn tag_keys(tag: &TagDef) -> Vec<String> {
    let point = tag.point;
    let mut keys = vec![
        format!("name = {}", quoted(&tag.short)),
        format!("table = {}", quoted(point.table.word())),
        format!("address = {}", point.address),
    ];
    if !point.table.is_bits() {
        keys.push(format!("type = {}", quoted(&point.kind.to_string())));
    }
    if point.order != ByteOrder::Abcd {
        keys.push(format!("order = {}", quoted(point.order.word())));
    }
    if let Some((low, width)) = point.field {
        let high = low + width - 1;
        keys.push(if low == high { format!("field = {low}") } else { format!("field = \"{high}-{low}\"") });
    }
    if !tag.is_text() {
        number_keys(tag, &mut keys);
    }
    writing_keys(tag, &mut keys);
    for (key, text) in [("group", &tag.group), ("label", &tag.label)] {
        keys.extend((!text.is_empty()).then(|| format!("{key} = {}", quoted(text))));
    }
    keys
}

/// The keys of a tag that is calculated.
pub fn calculated_keys(tag: &TagDef, expr: &str) -> Vec<String> {
    let mut keys = vec![format!("name = {}", quoted(&tag.short)), format!("expr = {}", quoted(expr))];
    if let Decimals::Fixed(decimals) = tag.decimals {
        keys.push(format!("decimals = {decimals}"));
    }
    for (key, text) in [("unit", &tag.unit), ("group", &tag.group), ("label", &tag.label)] {
        keys.extend((!text.is_empty()).then(|| format!("{key} = {}", quoted(text))));
    }
    keys
}

fn number(key: &str, value: f64) -> String {
    format!("{key} = {}", Value::from(value).to_string().trim())
}

/// What a number means.
fn number_keys(tag: &TagDef, keys: &mut Vec<String>) {
    keys.extend((tag.scale != 1.0).then(|| number("scale", tag.scale)));
    keys.extend((tag.offset != 0.0).then(|| number("offset", tag.offset)));
    if let Decimals::Fixed(decimals) = tag.decimals {
        keys.push(format!("decimals = {decimals}"));
    }
    keys.extend((!tag.unit.is_empty()).then(|| format!("unit = {}", quoted(&tag.unit))));
    if !tag.enum_labels.is_empty() {
        let labels = tag.enum_labels.iter().map(|(number, word)| format!("{number} = {}", quoted(word)));
        keys.push(format!("enum = {{ {} }}", labels.collect::<Vec<_>>().join(", ")));
    }
    if !tag.bit_labels.is_empty() {
        let labels = tag.bit_labels.iter().map(|(bit, word)| format!("{bit} = {}", quoted(word)));
        keys.push(format!("bits = {{ {} }}", labels.collect::<Vec<_>>().join(", ")));
    }
    if !tag.bad_if.is_empty() {
        let number = |raw| tag.point.raw_text(raw);
        let of_span = |bad: &BadSpan| match bad.single() {
            Some(bad) => number(bad),
            None => format!("[{}, {}]", number(bad.first), number(bad.last)),
        };
        let numbers = tag.bad_if.iter().map(of_span).collect::<Vec<_>>();
        keys.push(format!("bad_if = [{}]", numbers.join(", ")));
    }
    for (key, bound) in [("min", tag.min), ("max", tag.max)] {
        if let Some(Bound::Fixed(bound)) = bound {
            keys.push(number(key, bound.near()));
        }
    }
}

/// How it is written.
fn writing_keys(tag: &TagDef, keys: &mut Vec<String>) {
    if tag.access == Access::Read {
        return;
    }
    keys.push(format!("access = {}", quoted(tag.access.word())));
    if let Some((table, address)) = tag.write_at {
        keys.push(format!("write_address = \"{}:{address}\"", table.word()));
    }
    keys.extend(tag.read_modify_write.then(|| "write = \"rmw\"".to_owned()));
    keys.extend(tag.write_fc.map(|function| format!("write_fc = {function}")));
}

/// A string of TOML; what no editor shows is shown.
pub fn quoted(text: &str) -> String {
    Value::from(visible(text).as_ref()).to_string().trim().to_owned()
}
