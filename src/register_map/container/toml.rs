//! TOML.

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::node::{DEPTH_MAX, NODES_MAX, Node, Tree, Value, broken, too_much};

struct Reader {
    starts: Vec<usize>,
    nodes: usize,
}

/// Reads a text; a key that stands twice is an error of TOML.
pub fn parse(text: &str) -> Result<Tree, String> {
    let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let mut reader = Reader { starts, nodes: 0 };
    let table = DeTable::parse(text).map_err(|error| {
        let line = reader.line(error.span().map_or(0, |span| span.start));
        broken(line, error.message())
    })?;
    let value = reader.map(table.get_ref(), 0)?;
    Ok(Tree { root: Node { line: 1, value }, twice: Vec::new() })
}

impl Reader {
    fn line(&self, at: usize) -> usize {
        self.starts.partition_point(|start| *start <= at)
    }

    fn map(&mut self, table: &DeTable<'_>, depth: usize) -> Result<Value, String> {
        let entries = table.iter().map(|(key, value)| Ok((key.get_ref().to_string(), self.node(value, depth + 1)?)));
        Ok(Value::Map(entries.collect::<Result<_, String>>()?))
    }

    fn node(&mut self, value: &Spanned<DeValue<'_>>, depth: usize) -> Result<Node, String> {
        let line = self.line(value.span().start);
        self.nodes += 1;
        if DEPTH_MAX < depth || NODES_MAX < self.nodes {
            return Err(too_much(line));
        }
        let value = match value.get_ref() {
            DeValue::String(text) => Value::Scalar(text.to_string()),
            DeValue::Integer(number) => {
                let whole = i64::from_str_radix(number.as_str(), number.radix());
                Value::Scalar(whole.map_or_else(|_| number.as_str().to_owned(), |whole| whole.to_string()))
            }
            DeValue::Float(number) => Value::Scalar(number.as_str().to_owned()),
            DeValue::Boolean(flag) => Value::Scalar(flag.to_string()),
            DeValue::Datetime(time) => Value::Scalar(time.to_string()),
            DeValue::Array(items) => {
                let items = items.iter().map(|item| self.node(item, depth + 1));
                Value::List(items.collect::<Result<_, _>>()?)
            }
            DeValue::Table(table) => self.map(table, depth)?,
        };
        Ok(Node { line, value })
    }
}
