//! The elements of an XML file, as a tree of keys: an element with elements is a map, its attributes are keys with `@`.

use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};

use super::node::{DEPTH_MAX, NODES_MAX, Node, Tree, Value, broken, too_much};

/// An element that is open: name, line, entries, text.
type Open = (String, usize, Vec<(String, Node)>, String);

/// Reads a text. An element that stands several times is several entries of one key.
pub fn parse(text: &str) -> Result<Tree, String> {
    let starts: Vec<usize> = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let mut reader = Reader::from_str(text);
    let mut open: Vec<Open> = vec![(String::new(), 1, Vec::new(), String::new())];
    let mut nodes = 0;
    loop {
        let at = usize::try_from(reader.buffer_position()).unwrap_or(0);
        let line = starts.partition_point(|start| *start <= at);
        let event = reader.read_event().map_err(|error| broken(line, &error.to_string()))?;
        nodes += 1;
        if DEPTH_MAX < open.len() || NODES_MAX < nodes {
            return Err(too_much(line));
        }
        match event {
            Event::Start(tag) => open.push(opened(&tag, line)),
            Event::Empty(tag) => {
                open.push(opened(&tag, line));
                close(&mut open);
            }
            Event::End(_) => close(&mut open),
            Event::Text(text) => add(&mut open, &text),
            Event::CData(text) => add(&mut open, &text),
            Event::GeneralRef(name) => add(&mut open, &character(&name)),
            Event::Eof => break,
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
        }
    }
    let (_, _, entries, _) = open.swap_remove(0);
    Ok(Tree { root: Node { line: 1, value: Value::Map(entries) }, twice: Vec::new() })
}

fn opened(tag: &BytesStart<'_>, line: usize) -> Open {
    let attributes = tag.attributes().flatten();
    let attributes = attributes
        .map(|one| (format!("@{}", one.key.as_ref()), Node { line, value: Value::Scalar(one.value.into_owned()) }));
    (tag.name().as_ref().to_owned(), line, attributes.collect(), String::new())
}

fn close(open: &mut Vec<Open>) {
    // The first is the file itself.
    if open.len() < 2 {
        return;
    }
    let Some((name, line, entries, text)) = open.pop() else { return };
    let value = if entries.is_empty() { Value::Scalar(text.trim().to_owned()) } else { Value::Map(entries) };
    open.iter_mut()
        .last()
        .into_iter()
        .for_each(|(_, _, entries, _)| entries.push((name.clone(), Node { line, value: value.clone() })));
}

fn add(open: &mut [Open], text: &str) {
    open.iter_mut().last().into_iter().for_each(|(.., own)| own.push_str(text));
}

/// The characters that XML names.
fn character(name: &str) -> String {
    let named = [("lt", '<'), ("gt", '>'), ("amp", '&'), ("quot", '"'), ("apos", '\'')];
    let number = || {
        let digits = name.strip_prefix('#')?;
        let hex = digits.strip_prefix(['x', 'X']).map(|digits| u32::from_str_radix(digits, 16));
        char::from_u32(hex.unwrap_or_else(|| digits.parse()).ok()?)
    };
    let found = named.iter().find(|(own, _)| *own == name).map(|(_, sign)| *sign);
    found.or_else(number).unwrap_or('·').to_string()
}
