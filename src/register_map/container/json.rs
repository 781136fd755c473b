//! JSON, also with comments, as the templates of controllers have them.

use jsonc_parser::{CollectOptions, ParseOptions, ast, common::Ranged, parse_to_ast};

use super::node::{DEPTH_MAX, NODES_MAX, Node, Tree, Value, broken, doubled, too_much};
use crate::register_map::list::{cells::Cells, titled};

/// More keys than this are no table.
const COLUMNS_MAX: usize = 1_000;

struct Reader {
    /// Where each line begins.
    starts: Vec<usize>,
    twice: Vec<(usize, String)>,
    nodes: usize,
}

/// Reads a text.
pub fn parse(text: &str) -> Result<Tree, String> {
    let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let mut reader = Reader { starts, twice: Vec::new(), nodes: 0 };
    let options =
        ParseOptions { allow_missing_commas: false, allow_loose_object_property_names: false, ..Default::default() };
    let parsed = parse_to_ast(text, &CollectOptions::default(), &options);
    let parsed = parsed.map_err(|error| broken(reader.line(error.range().start), &error.kind().to_string()))?;
    let root = match &parsed.value {
        Some(value) => reader.node(value, 0)?,
        None => Node { line: 1, value: Value::Empty },
    };
    Ok(Tree { root, twice: reader.twice })
}

/// Each array of objects without arrays and objects of their own, as rows below their keys; what it is called may name their
/// table. `None` where there is none, or where only some of several are named so.
pub fn tables(tree: &Tree) -> Option<Vec<Vec<Cells>>> {
    let is_flat = |item: &Node| {
        !item.entries().is_empty()
            && item.entries().iter().all(|(_, node)| matches!(node.value, Value::Empty | Value::Scalar(_)))
    };
    let is_table = |node: &Node| {
        matches!(node.value, Value::List(_)) && !node.items().is_empty() && node.items().iter().all(is_flat)
    };
    let whole = [(String::new(), tree.root.clone())];
    let named = tree.root.entries().iter().chain(&whole).filter(|(_, node)| is_table(node));
    let tables: Vec<(Option<Cells>, &Node)> = named.map(|(name, node)| (titled(name), node)).collect();
    let is_clear = tables.len() == 1 || tables.iter().all(|(title, _)| title.is_some());
    (is_clear && !tables.is_empty()).then(|| tables.into_iter().map(|(title, node)| rows(title, node)).collect())
}

fn rows(title: Option<Cells>, node: &Node) -> Vec<Cells> {
    let mut keys: Vec<String> = Vec::new();
    for (key, _) in node.items().iter().flat_map(Node::entries) {
        if keys.len() < COLUMNS_MAX && !keys.contains(key) {
            keys.push(key.clone());
        }
    }
    let row = |line, cells| Cells { line, cells, is_unclosed: false, is_ruled: false };
    let below = node.items().iter().map(|item| {
        let cell = |key: &String| item.word(key).unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
        row(item.line, keys.iter().map(cell).collect())
    });
    title.into_iter().chain([row(node.line, keys.clone())]).chain(below).collect()
}

impl Reader {
    fn line(&self, at: usize) -> usize {
        self.starts.partition_point(|start| *start <= at)
    }

    fn node(&mut self, value: &ast::Value<'_>, depth: usize) -> Result<Node, String> {
        let line = self.line(value.start());
        self.nodes += 1;
        if DEPTH_MAX < depth || NODES_MAX < self.nodes {
            return Err(too_much(line));
        }
        let value = match value {
            ast::Value::NullKeyword(_) => Value::Empty,
            ast::Value::StringLit(text) => Value::Scalar(text.value.to_string()),
            ast::Value::NumberLit(number) => Value::Scalar(number.value.to_owned()),
            ast::Value::BooleanLit(flag) => Value::Scalar(flag.value.to_string()),
            ast::Value::Array(items) => {
                let items = items.elements.iter().map(|item| self.node(item, depth + 1));
                Value::List(items.collect::<Result<_, _>>()?)
            }
            ast::Value::Object(object) => {
                let entries = object.properties.iter();
                let entries = entries.map(|one| Ok((one.name.as_str().to_owned(), self.node(&one.value, depth + 1)?)));
                let entries = entries.collect::<Result<Vec<_>, String>>()?;
                self.twice.extend(doubled(&entries));
                Value::Map(entries)
            }
        };
        Ok(Node { line, value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_comments_and_doubled_keys_are_read() {
        let tree =
            parse("{ // of a maker\n \"a\": [1, 2.5,\n true],\n \"b\": null,\n \"a\": \"x\" }").expect("it is JSON");
        assert_eq!(tree.root.word("a"), Some("x"));
        assert_eq!((tree.root.get("b"), &tree.twice[..]), (None, &[(5, "a".to_owned())][..]));
        for wrong in ["{", "{ \"a\" 1 }", "nonsense", &"[".repeat(5_000)] {
            assert!(parse(wrong).is_err(), "{:.20}", wrong);
        }
    }
}
