//! Reads a condition over tags: `PLC-1.HEATER = ON and (PLC-1.LT-1 > 5 cm or not PLC-1.AUTO = AUTO)`.

use super::{
    diagnostic::{Problems, Span},
    names::{Defs, number_of},
    reader::{At, Choice},
};
use crate::plant::{
    expr::{Compare, Expr},
    tag::TagDef,
};

/// Parentheses inside each other, and `not` before `not`: more than anybody can read.
const DEPTH_MAX: usize = 16;
/// What a comparison can be.
const COMPARES: [(&str, Compare); 6] = [
    ("!=", Compare::Differs),
    ("<=", Compare::AtMost),
    (">=", Compare::AtLeast),
    ("=", Compare::Equal),
    ("<", Compare::Below),
    (">", Compare::Above),
];

/// The condition that is written in a string. `None` after the problem was added.
pub(super) fn expr(words: &At<String>, defs: &Defs, problems: &mut Problems) -> Option<Expr> {
    let tokens = tokens(&words.value).into_iter();
    let tokens = tokens.map(|(start, word)| At { value: word, at: words.at.inside_quotes(start, word.len()) });
    let mut reader = Reader { tokens: tokens.collect(), next: 0, depth: 0, end: words.at, defs, problems };
    let expr = reader.any()?;
    match reader.peek() {
        None => Some(expr),
        Some(token) => {
            let (at, word) = (token.at, token.value);
            reader.problems.add(at, format!("`{word}` is one too many")).label("expected `and`, `or` or the end");
            None
        }
    }
}

/// Words, comparisons and parentheses, each with the byte where it starts.
fn tokens(text: &str) -> Vec<(usize, &str)> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = if first.is_whitespace() {
            at += first.len_utf8();
            continue;
        } else if first == '(' || first == ')' {
            1
        } else if let Some((word, _)) = COMPARES.iter().find(|(word, _)| rest.starts_with(word)) {
            word.len()
        } else {
            let ends = |c: char| c.is_whitespace() || "()=<>!".contains(c);
            // A lone `!` is a word of its own, so that the reader always goes on.
            rest.find(ends).filter(|end| 0 < *end).unwrap_or(if first == '!' { 1 } else { rest.len() })
        };
        tokens.push((at, &rest[..length]));
        at += length;
    }
    tokens
}

struct Reader<'a, 'd> {
    tokens: Vec<At<&'a str>>,
    next: usize,
    depth: usize,
    /// The whole string, for what is missing at its end.
    end: Span,
    defs: &'a Defs<'d>,
    problems: &'a mut Problems,
}

impl<'a> Reader<'a, '_> {
    fn peek(&self) -> Option<At<&'a str>> {
        self.tokens.get(self.next).copied()
    }

    fn take(&mut self) -> Option<At<&'a str>> {
        let token = self.peek();
        self.next += 1;
        token
    }

    fn takes(&mut self, word: &str) -> bool {
        let found = self.peek().is_some_and(|token| token.value == word);
        self.next += usize::from(found);
        found
    }

    fn any(&mut self) -> Option<Expr> {
        let mut parts = vec![self.all()?];
        while self.takes("or") {
            parts.push(self.all()?);
        }
        Some(if parts.len() == 1 { parts.remove(0) } else { Expr::Any(parts) })
    }

    fn all(&mut self) -> Option<Expr> {
        let mut parts = vec![self.one()?];
        while self.takes("and") {
            parts.push(self.one()?);
        }
        Some(if parts.len() == 1 { parts.remove(0) } else { Expr::All(parts) })
    }

    fn one(&mut self) -> Option<Expr> {
        self.depth += 1;
        let at = self.peek().map_or(self.end, |token| token.at);
        if DEPTH_MAX < self.depth {
            self.problems.add(at, "parentheses nested too deeply").label("too deep");
            return None;
        }
        let expr = if self.takes("not") {
            Expr::Not(Box::new(self.one()?))
        } else if self.takes("(") {
            let inner = self.any()?;
            if !self.takes(")") {
                let at_end = self.peek().map_or(self.end, |token| token.at);
                self.problems.add(at_end, "a parenthesis is not closed").label("expected `)`").also(at, "opened here");
                return None;
            }
            inner
        } else {
            self.test()?
        };
        self.depth -= 1;
        Some(expr)
    }

    /// `TAG compare value`.
    fn test(&mut self) -> Option<Expr> {
        let name = self.take().filter(|token| !is_sign(token.value));
        let Some(name) = name else {
            let at = self.tokens.get(self.next - 1).map_or(self.end, |token| token.at);
            self.problems.add(at, "a tag is missing").label("expected DEVICE.TAG, `not` or `(`");
            return None;
        };
        let tag = self.defs.tag(&At { value: name.value.to_owned(), at: name.at }, self.problems)?;
        let found = self.take();
        let compare = found.and_then(|found| COMPARES.iter().find(|(word, _)| *word == found.value));
        let Some((_, compare)) = compare else {
            let at = found.map_or(self.end, |found| found.at);
            let problem = self.problems.add(at, format!("how is {} compared?", tag.name));
            problem.label("expected `=`, `!=`, `<`, `<=`, `>` or `>=`");
            return None;
        };
        let value = self.value(tag)?;
        Some(Expr::Test { tag: tag.id, compare: *compare, value })
    }

    /// A number with or without the tag's unit, or a label, which may have several words.
    fn value(&mut self, tag: &TagDef) -> Option<f64> {
        let start = self.next;
        while self.peek().is_some_and(|token| !is_sign(token.value) && !["and", "or"].contains(&token.value)) {
            self.next += 1;
        }
        let words = &self.tokens[start..self.next];
        let (Some(first), Some(last)) = (words.first(), words.last()) else {
            let at = self.peek().map_or(self.end, |token| token.at);
            self.problems.add(at, format!("{} is compared with nothing", tag.name)).label("expected a value");
            return None;
        };
        let at = Span { end: last.at.end, ..first.at };
        let text = words.iter().map(|word| word.value).collect::<Vec<_>>().join(" ");
        if let Ok(number) = first.value.parse::<f64>()
            && number.is_finite()
            && tag.labels.is_empty()
        {
            let unit = text[first.value.len()..].trim();
            if !unit.is_empty() && unit != tag.unit {
                let problem = self.problems.add(at, format!("`{unit}` is not the unit of {}", tag.name));
                problem.label(if tag.unit.is_empty() {
                    "it has none".into()
                } else {
                    format!("expected {}", tag.unit)
                });
                return None;
            }
            return Some(number);
        }
        let choice = text.parse().map_or(Choice::Word(text), Choice::Number);
        number_of(&At { value: choice, at }, tag, self.problems)
    }
}

fn is_sign(word: &str) -> bool {
    word == "(" || word == ")" || COMPARES.iter().any(|(sign, _)| *sign == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_signs_and_parentheses_need_no_spaces() {
        let check = |text: &str, expect: &[&str]| {
            let found: Vec<&str> = tokens(text).into_iter().map(|(_, word)| word).collect();
            assert_eq!(found, expect, "{text}");
        };
        check("PLC-1.RUN=RUN and(T.L>=5.5 cm)", &["PLC-1.RUN", "=", "RUN", "and", "(", "T.L", ">=", "5.5", "cm", ")"]);
        check("a!=b ! <", &["a", "!=", "b", "!", "<"]);
        check("ü.ß = 1", &["ü.ß", "=", "1"]);
        check("", &[]);
    }
}
