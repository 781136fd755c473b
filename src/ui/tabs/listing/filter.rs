//! What is typed to show fewer rows: words that a row must have, and conditions such as `pv > 60`.

use super::column::{Column, figure};
use crate::ui::tabs::prelude::*;

/// The figure of a column above or below a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Condition {
    column: usize,
    above: bool,
    limit: f64,
}

/// A typed filter, read for the columns of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    words: Words,
    conditions: Vec<Condition>,
}

impl Filter {
    /// Reads `pv > 60 er<-1 hot`; a word that is the heading of no column, or has no figure behind it, is a word.
    pub fn parse(typed: &str, heads: &[&str]) -> Filter {
        let spaced = typed.replace('>', " > ").replace('<', " < ");
        let mut tokens: &[&str] = &spaced.split_whitespace().collect::<Vec<_>>();
        let (mut words, mut conditions) = (Vec::new(), Vec::new());
        while let [first, behind @ ..] = tokens {
            tokens = behind;
            match condition(heads, first, behind) {
                Some(condition) => {
                    conditions.push(condition);
                    tokens = behind.get(2..).unwrap_or_default();
                }
                None => words.push(*first),
            }
        }
        Filter { words: Words::parse(&words.join(" ")), conditions }
    }

    pub fn has_words(&self) -> bool {
        !self.words.is_empty()
    }

    pub fn fits_text(&self, text: &str) -> bool {
        self.words.fit(text)
    }

    /// What has no figure is neither above nor below.
    pub fn fits_figures<R: ?Sized>(&self, cx: &ViewContext, columns: &[Column<R>], row: &R) -> bool {
        self.conditions.iter().all(|condition| {
            let text = columns.get(condition.column).map(|column| column.text(cx, row, u16::MAX));
            let figure = text.as_deref().and_then(figure);
            figure
                .is_some_and(|figure| if condition.above { figure > condition.limit } else { figure < condition.limit })
        })
    }
}

fn condition(heads: &[&str], first: &str, behind: &[&str]) -> Option<Condition> {
    let [sign @ (">" | "<"), limit, ..] = behind else { return None };
    let column = heads.iter().position(|head| !head.is_empty() && head.to_lowercase() == first.to_lowercase())?;
    let limit = limit.parse::<f64>().ok().filter(|limit| limit.is_finite())?;
    Some(Condition { column, above: *sign == ">", limit })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_conditions_are_distinguished() {
        let heads = ["", "SV", "PV", "ER"];
        let condition = |column, above, limit| Condition { column, above, limit };
        for (typed, conditions, words) in [
            ("14:05", vec![], "14:05"),
            ("2026-11-26 14:05", vec![], "2026-11-26 14:05"),
            ("PV>60", vec![condition(2, true, 60.0)], ""),
            ("er < -1 hot sv > 2", vec![condition(3, false, -1.0), condition(1, true, 2.0)], "hot"),
            ("", vec![], ""),
            ("mv > 3", vec![], "mv > 3"),
            ("pv > nan", vec![], "pv > nan"),
            ("pv >", vec![], "pv >"),
        ] {
            assert_eq!(Filter::parse(typed, &heads), Filter { words: Words::parse(words), conditions }, "{typed}");
        }
    }
}
