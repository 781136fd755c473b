//! The name of a data type.

use super::{
    diagnostic::{Problems, Span},
    reader::{Node, Value},
};
use crate::plant::{data_type::UnknownType, tag::DataType};

/// The type of a raw value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TypeName(pub DataType);

impl Value for TypeName {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let word = <String as Value>::read(value, at, problems)?;
        match word.parse() {
            Ok(kind) => return Some(TypeName(kind)),
            Err(UnknownType::Length(most)) => {
                let name = word.split('(').next().unwrap_or_default();
                let problem = problems.add(at, format!("`{word}` does not say how long the text is"));
                let unit = if most == DataType::CHARS_MAX { "registers" } else { "bytes" };
                problem.label(format!("expected \"{name}(N)\" with N {unit}, 1 to {most}"));
            }
            Err(UnknownType::Name) => {
                let names: Vec<String> = DataType::NUMBERS.into_iter().map(|kind| kind.to_string()).collect();
                let problem = problems.add(at, format!("unknown type `{word}`")).label("not a type");
                problem.suggest(&word, names.iter().map(String::as_str));
            }
        }
        None
    }
}
