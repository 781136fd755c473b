//! YAML, with anchors and merged keys; tags are passed over.

use std::collections::HashMap;

use saphyr_parser::{Event, Parser, Span};

use super::node::{DEPTH_MAX, NODES_MAX, Node, Tree, Value, broken, doubled, too_much};
use crate::t;

/// What is still open.
enum Open {
    List(usize, usize, Vec<Node>),
    Map { line: usize, anchor: usize, merged: usize, entries: Vec<(String, Node)>, key: Option<String> },
}

#[derive(Default)]
struct Builder {
    open: Vec<Open>,
    anchors: HashMap<usize, Node>,
    twice: Vec<(usize, String)>,
    root: Option<Node>,
    nodes: usize,
}

/// Reads a text of one document; a second one is none of what is read here, and refused rather than lost.
pub fn parse(text: &str) -> Result<Tree, String> {
    let mut builder = Builder::default();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|error| broken(error.marker().line(), error.info()))?;
        builder.on(event, span)?;
    }
    let root = builder.root.unwrap_or(Node { line: 1, value: Value::Empty });
    Ok(Tree { root, twice: builder.twice })
}

impl Builder {
    fn on(&mut self, event: Event<'_>, span: Span) -> Result<(), String> {
        let line = span.start.line();
        match event {
            Event::SequenceStart(anchor, _) => self.open.push(Open::List(line, anchor, Vec::new())),
            Event::MappingStart(anchor, _) => {
                self.open.push(Open::Map { line, anchor, merged: 0, entries: Vec::new(), key: None });
            }
            Event::Scalar(text, style, anchor, _) => {
                let is_plain = style == saphyr_parser::ScalarStyle::Plain;
                let is_empty = is_plain && matches!(&*text, "" | "~" | "null" | "Null" | "NULL");
                let value = if is_empty { Value::Empty } else { Value::Scalar(text.into_owned()) };
                self.close(Node { line, value }, anchor)?;
            }
            Event::Alias(anchor) => {
                let node = self.anchors.get(&anchor).cloned().unwrap_or(Node { line, value: Value::Empty });
                // What is copied counts: a few lines of aliases of aliases are millions of nodes.
                self.nodes += size(&node);
                self.close(Node { line, ..node }, 0)?;
            }
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(Open::List(line, anchor, items)) => {
                    self.close(Node { line, value: Value::List(items) }, anchor)?
                }
                Some(Open::Map { line, anchor, merged, entries, .. }) => {
                    self.twice.extend(doubled(&entries[merged..]));
                    self.close(Node { line, value: Value::Map(entries) }, anchor)?;
                }
                None => {}
            },
            Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentStart(_) | Event::DocumentEnd => {}
        }
        if DEPTH_MAX < self.open.len() { Err(too_much(line)) } else { Ok(()) }
    }

    /// A node is whole: it goes to what is open.
    fn close(&mut self, node: Node, anchor: usize) -> Result<(), String> {
        self.nodes += 1;
        if NODES_MAX < self.nodes {
            return Err(too_much(node.line));
        }
        if anchor != 0 {
            self.nodes += size(&node);
            self.anchors.insert(anchor, node.clone());
        }
        match self.open.last_mut() {
            None if node.value == Value::Empty => {}
            None if self.root.is_some() => return Err(t!("line {line}: a second document begins", line = node.line)),
            None => self.root = Some(node),
            Some(Open::List(_, _, items)) => items.push(node),
            Some(Open::Map { entries, key, merged, .. }) => match key.take() {
                None => *key = Some(node.shown()),
                Some(word) if word == "<<" => *merged += merge(entries, node),
                Some(word) => entries.push((word, node)),
            },
        }
        Ok(())
    }
}

/// The keys of an anchor, in front of those that stand here, which count. How many they are.
fn merge(entries: &mut Vec<(String, Node)>, node: Node) -> usize {
    let before = entries.len();
    let maps = if let Value::List(items) = node.value { items } else { vec![node] };
    for map in maps {
        if let Value::Map(merged) = map.value {
            entries.splice(0..0, merged);
        }
    }
    entries.len() - before
}

fn size(node: &Node) -> usize {
    1 + match &node.value {
        Value::List(items) => items.iter().map(size).sum(),
        Value::Map(entries) => entries.iter().map(|(_, node)| size(node)).sum(),
        Value::Empty | Value::Scalar(_) => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_anchors_tags_and_doubled_keys_are_read() {
        let text = "a: &x\n  one: 1\nb:\n  <<: *x\n  two: !secret 0x10\n  two: 3\nc: [*x, ~]\n";
        let tree = parse(text).expect("it is YAML");
        let b = tree.root.get("b").expect("it is there");
        assert_eq!((b.get("one").and_then(Node::whole), b.get("two").and_then(Node::whole)), (Some(1), Some(3)));
        assert_eq!(b.get("two").map(|node| node.line), Some(6));
        assert_eq!(tree.twice, [(6, "two".to_owned())]);
        assert_eq!(tree.root.all("c").len(), 2);
    }

    #[test]
    fn deep_and_multiplying_files_are_refused() {
        let bomb: String =
            (0..30).map(|n| format!("a{n}: &a{n} [*a{m},*a{m},*a{m},*a{m}]\n", m = n.max(1) - 1)).collect();
        assert!(parse(&format!("z: &a0 [1]\n{}", bomb.replacen("a0: &a0 [*a0,*a0,*a0,*a0]\n", "", 1))).is_err());
        assert!(parse(&"[".repeat(100_000)).is_err());
        assert!(parse(&"- ".repeat(3_000)).is_err());
        assert!(parse("a: [1\nb: }").is_err());
    }

    #[test]
    fn a_second_document_is_refused_by_its_line() {
        assert_eq!(parse("a: 1\n---\nb: 2\n").err().as_deref(), Some("line 3: a second document begins"));
        let root = |text: &str| parse(text).expect("it is one document").root;
        for text in ["---\na: 1\n", "a: 1\n---\n", "a: 1\n...\n", "---\n# none\n---\na: 1\n---\n"] {
            assert_eq!(root(text).get("a").and_then(Node::whole), Some(1), "{text}");
        }
    }
}
