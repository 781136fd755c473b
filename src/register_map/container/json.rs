//! JSON, also with comments, as the templates of controllers have them.

use jsonc_parser::{CollectOptions, ParseOptions, ast, common::Ranged, parse_to_ast};

use super::node::{DEPTH_MAX, NODES_MAX, Node, Tree, Value, broken, doubled, too_much};

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
