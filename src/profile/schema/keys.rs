//! Keys of a device profile that may be written in several forms.

use std::time::Duration;

use super::device::{CounterTable, PollWord};
use crate::{
    plant::def::{Priority, Role},
    profile::{
        diagnostic::{Problems, Span},
        reader::{At, Choice, Node, Raw, Value},
    },
};

/// How often a tag is read: a word, or its own period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PollKey {
    Word(PollWord),
    Every(Duration),
}

impl Value for PollKey {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Text(text) if text.starts_with(|first: char| first.is_ascii_digit()) => {
                Duration::read(value, at, problems).map(PollKey::Every)
            }
            _ => PollWord::read(value, at, problems).map(PollKey::Word),
        }
    }
}

/// The least role that may write something: one that writes at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WriteRole(pub Role);

/// Whether a tag counts up, and after how much it shows the same again.
#[derive(Debug, Clone, Copy)]
pub(crate) enum CounterKey {
    Counts(bool),
    Rolls(Option<At<f64>>),
}

impl Value for CounterKey {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<CounterKey> {
        match value {
            Node::Table(_) => CounterTable::read(value, at, problems).map(|table| CounterKey::Rolls(table.modulus)),
            _ => bool::read(value, at, problems).map(CounterKey::Counts),
        }
    }
}

impl Value for WriteRole {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let role = <Role as Value>::read(value, at, problems)?;
        if role == Role::Viewer {
            let problem = problems.add(at, "a viewer writes nothing");
            problem.label("expected \"technician\" or \"supervisor\"");
        }
        Some(WriteRole(role))
    }
}

/// A table with names for keys.
#[derive(Debug, Clone)]
pub(crate) struct ByName<T>(pub Vec<(At<String>, At<T>)>);

/// The names are those of alarms of the profile: `{ "motor hot" = "low", "door open" = "off" }`.
pub(crate) type Priorities = ByName<PriorityKey>;
/// The priority of an alarm; `None`: there is no such alarm here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PriorityKey(pub Option<Priority>);

impl Value for PriorityKey {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Text(word) if word == "off" => Some(PriorityKey(None)),
            _ => <Priority as Value>::read(value, at, problems).map(|priority| PriorityKey(Some(priority))),
        }
    }
}

/// The names are those of groups: `{ PID = "supervisor" }`.
pub(crate) type Roles = ByName<WriteRole>;
/// The names are those of tags: `{ P-DP = 1 }`.
pub(crate) type Stated = ByName<Choice>;

impl<T: Value> Value for ByName<T> {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let raw = Raw::read(value, at, problems)?;
        let mut of_name = |(name, (at, node)): (&String, &(Span, At<Node>))| {
            let value = T::read(&node.value, node.at, problems)?;
            Some((At { value: name.clone(), at: *at }, At { value, at: node.at }))
        };
        Some(ByName(raw.table.iter().filter_map(&mut of_name).collect()))
    }
}

/// A number or a word, or several of them in an array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Choices(pub Vec<At<Choice>>);

impl Value for Choices {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let one = |value: &Node, at: Span, problems: &mut Problems| {
            Choice::read(value, at, problems).map(|value| At { value, at })
        };
        match value {
            Node::Array(array) => {
                Some(Choices(array.iter().filter_map(|item| one(&item.value, item.at, problems)).collect()))
            }
            _ => one(value, at, problems).map(|choice| Choices(vec![choice])),
        }
    }
}
