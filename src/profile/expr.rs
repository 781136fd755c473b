//! Reads an expression over tags: `PLC-1.HEATER = ON and (PLC-1.LT-1 > 5 cm or not PLC-1.AUTO = AUTO)`,
//! `max(TIC-1.PV, TIC-2.PV) - 5`. A name may hold `-`, `+` and `/`, so that these are operators only between spaces.

mod identity;
mod over_time;

use over_time::is_over_time;

use super::{
    diagnostic::{Problems, Span},
    names::{Defs, check_number, exact_of},
    reader::{At, Choice},
    units,
};
use crate::plant::{
    calculation_def::OverTime,
    def::DeviceId,
    delay::Edge,
    exact::Exact,
    expr::{Compare, Expr, Function, Operator},
    tag::TagDef,
    totalizer::Total,
};

/// Parentheses inside each other, and `not` before `not`: more than anybody can read.
const DEPTH_MAX: usize = 16;
/// Words and signs of an expression: as many operations may lie inside each other.
const TOKENS_MAX: usize = 1_000;
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
    condition(words, None, None, defs, problems)
}

/// What must hold for a device to have a tag: its tags may be named without it, and what it says of itself counts.
pub(super) fn of_tag(words: &At<String>, tag: &TagDef, defs: &Defs, problems: &mut Problems) -> Option<Expr> {
    let device = tag.name.split_once('.').map(|(device, _)| device);
    condition(words, device, Some(tag.device), defs, problems)
}

fn condition(
    words: &At<String>,
    device: Option<&str>,
    identified: Option<DeviceId>,
    defs: &Defs,
    problems: &mut Problems,
) -> Option<Expr> {
    let expr = read(words, device, defs, problems, |reader| {
        reader.identified = identified;
        reader.any()
    })?;
    if !is_condition(&expr) {
        no_condition(words.at, problems);
        return None;
    }
    Some(expr)
}

/// Is it true or false?
fn is_condition(expr: &Expr) -> bool {
    !matches!(expr, Expr::Number(_) | Expr::Tag(_) | Expr::Arithmetic(..) | Expr::Call(..))
}

fn no_condition(at: Span, problems: &mut Problems) {
    problems.add(at, "this is a number, not a condition").label("expected `=`, `!=`, `<`, `<=`, `>` or `>=`");
}

/// What a calculated tag is: an expression, or what becomes of one over time. The tags of `device` may be named without it.
pub(super) fn calculated(
    words: &At<String>,
    device: Option<&str>,
    defs: &Defs,
    problems: &mut Problems,
) -> Option<(Option<OverTime>, Expr)> {
    read(words, device, defs, problems, |reader| reader.over_time())
}

/// All that is written in a string.
fn read<T>(
    words: &At<String>,
    device: Option<&str>,
    defs: &Defs,
    problems: &mut Problems,
    what: impl FnOnce(&mut Reader) -> Option<T>,
) -> Option<T> {
    let text = words.value.as_str();
    let (starts, tokens): (Vec<usize>, Vec<At<&str>>) = tokens(text)
        .into_iter()
        .map(|(start, word)| (start, At { value: word, at: words.at.inside_quotes(start, word.len()) }))
        .unzip();
    if let Some(token) = tokens.get(TOKENS_MAX) {
        problems
            .add(token.at, "the expression is too long")
            .label(format!("expected at most {TOKENS_MAX} words and signs"));
        return None;
    }
    let mut reader = Reader {
        text,
        starts,
        tokens,
        next: 0,
        depth: 0,
        calls: 0,
        end: words.at,
        device,
        identified: None,
        defs,
        problems,
    };
    let found = what(&mut reader)?;
    match reader.peek() {
        None => Some(found),
        Some(token) => {
            let (at, word) = (token.at, token.value);
            reader
                .problems
                .add(at, format!("`{word}` is one too many"))
                .label("expected an operator, `and`, `or` or the end");
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
        } else if "(),*".contains(first) {
            1
        } else if let Some(length) = identity::quoted(rest) {
            length
        } else if let Some((word, _)) = COMPARES.iter().find(|(word, _)| rest.starts_with(word)) {
            word.len()
        } else {
            let ends = |c: char| c.is_whitespace() || "()=<>!,*".contains(c);
            // A lone `!` is a word of its own, so that the reader always goes on.
            rest.find(ends).filter(|end| 0 < *end).unwrap_or(if first == '!' { 1 } else { rest.len() })
        };
        tokens.push((at, &rest[..length]));
        at += length;
    }
    tokens
}

struct Reader<'a, 'd> {
    text: &'a str,
    /// The byte where each token starts.
    starts: Vec<usize>,
    tokens: Vec<At<&'a str>>,
    next: usize,
    depth: usize,
    /// Functions whose parenthesis is open.
    calls: usize,
    /// The whole string, for what is missing at its end.
    end: Span,
    /// Where names are looked up first.
    device: Option<&'a str>,
    /// The device that says of itself what is compared; `None` where that does not count.
    identified: Option<DeviceId>,
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
        if self.takes("not") {
            return self.nested(|reader| Some(Expr::Not(Box::new(reader.one()?))));
        }
        if let Some(test) = self.identity_test() {
            return test.map(Expr::Identity);
        }
        let left = self.sum()?;
        let found = self.peek().and_then(|found| COMPARES.iter().find(|(word, _)| *word == found.value));
        let Some((_, compare)) = found else { return Some(left) };
        self.next += 1;
        let right = match &left {
            Expr::Tag(tag) => self.value(&self.defs.tags[tag.index()])?,
            _ => self.sum()?,
        };
        Some(Expr::Test(Box::new(left), *compare, Box::new(right)))
    }

    /// One level deeper, unless that is too deep.
    fn nested(&mut self, read: impl FnOnce(&mut Self) -> Option<Expr>) -> Option<Expr> {
        self.depth += 1;
        if DEPTH_MAX < self.depth {
            let at = self.peek().map_or(self.end, |token| token.at);
            self.problems.add(at, "parentheses nested too deeply").label("too deep");
            return None;
        }
        let expr = read(self)?;
        self.depth -= 1;
        Some(expr)
    }

    fn sum(&mut self) -> Option<Expr> {
        self.chain(&[Operator::Add, Operator::Subtract], Self::product)
    }

    fn product(&mut self) -> Option<Expr> {
        self.chain(&[Operator::Multiply, Operator::Divide], Self::operand)
    }

    /// Operators of one rank, from left to right.
    fn chain(&mut self, operators: &[Operator], part: fn(&mut Self) -> Option<Expr>) -> Option<Expr> {
        let mut expr = part(self)?;
        while let Some(operator) = operators.iter().copied().find(|operator| self.takes(operator.word())) {
            expr = Expr::Arithmetic(Box::new(expr), operator, Box::new(part(self)?));
        }
        Some(expr)
    }

    /// A number, a tag, a function or what stands in parentheses.
    fn operand(&mut self) -> Option<Expr> {
        let token = self.take().filter(|token| !is_sign(token.value) || token.value == "(");
        let Some(token) = token else {
            let at = self.tokens.get(self.next - 1).map_or(self.end, |token| token.at);
            self.problems.add(at, "a tag is missing").label("expected DEVICE.TAG, a number, `not` or `(`");
            return None;
        };
        if token.value == "(" {
            let calls = std::mem::take(&mut self.calls);
            let inner = self.nested(Self::any)?;
            self.calls = calls;
            self.close(token.at)?;
            return Some(inner);
        }
        if let Some(number) = token.value.parse::<Exact>().ok().filter(|number| number.is_finite()) {
            return Some(Expr::Number(number));
        }
        if self.peek().is_some_and(|next| next.value == "(") {
            return self.call(token);
        }
        let name = At { value: token.value.to_owned(), at: token.at };
        let id = match self.device {
            Some(device) if !self.defs.names.tags.contains_key(&name.value) && !name.value.contains('.') => {
                self.defs.names.near(&name, device, self.problems)
            }
            Some(device) if self.defs.names.tags.contains_key(&format!("{device}.{}", name.value)) => {
                self.defs.names.near(&name, device, self.problems)
            }
            _ => self.defs.names.full(&name, self.problems),
        }?;
        check_number(token.at, &self.defs.tags[id.index()], self.problems);
        Some(Expr::Tag(id))
    }

    fn call(&mut self, name: At<&'a str>) -> Option<Expr> {
        if is_over_time(name.value) {
            let message = format!("`{}` cannot be part of an expression", name.value);
            self.problems.add(name.at, message).label("expected a calculated tag of its own, and its name here");
            return None;
        }
        let Some(function) = Function::ALL.into_iter().find(|function| function.word() == name.value) else {
            let problem = self.problems.add(name.at, format!("unknown function `{}`", name.value));
            let (totals, edges) = (Total::ALL.map(Total::word), Edge::ALL.map(Edge::word));
            let known = [Function::ALL.map(Function::word).as_slice(), &totals, &edges].concat();
            problem.label(format!("expected one of {}", known.join(", "))).suggest(name.value, known);
            return None;
        };
        self.next += 1;
        self.calls += 1;
        let mut of = vec![self.nested(Self::any)?];
        while self.takes(",") {
            of.push(self.nested(Self::any)?);
        }
        self.calls -= 1;
        self.close(name.at)?;
        if function == Function::Abs && of.len() != 1 {
            self.problems.add(name.at, "abs is of one number").label(format!("found {}", of.len()));
            return None;
        }
        Some(Expr::Call(function, of))
    }

    fn close(&mut self, opened: Span) -> Option<()> {
        if self.takes(")") {
            return Some(());
        }
        let at = self.peek().map_or(self.end, |token| token.at);
        self.problems.add(at, "a parenthesis is not closed").label("expected `)`").also(opened, "opened here");
        None
    }

    /// What a tag is compared with: a number with or without the tag's unit, a label, which may have several words, or an
    /// expression.
    fn value(&mut self, tag: &TagDef) -> Option<Expr> {
        let start = self.next;
        let ends = |token: &At<&str>| {
            let comma = token.value == ",";
            (is_sign(token.value) && !comma) || (comma && self.calls > 0) || ["and", "or"].contains(&token.value)
        };
        let count = self.tokens[start..].iter().take_while(|token| !ends(token)).count();
        let words = &self.tokens[start..start + count];
        let (Some(first), Some(last)) = (words.first(), words.last()) else {
            if self.peek().is_some_and(|next| next.value == "(") {
                return self.sum();
            }
            let at = self.peek().map_or(self.end, |token| token.at);
            self.problems.add(at, format!("{} is compared with nothing", tag.name)).label("expected a value");
            return None;
        };
        let at = Span { end: last.at.end, ..first.at };
        let text = self.text[self.starts[start]..self.starts[start + count - 1] + last.value.len()].to_owned();
        let is_label = tag.enum_labels.iter().any(|(_, label)| *label == text);
        let in_device = self.device.map(|device| format!("{device}.{}", first.value));
        let is_tag = [Some(first.value), in_device.as_deref()]
            .into_iter()
            .flatten()
            .any(|name| self.defs.names.tags.contains_key(name));
        let is_call = self.tokens.get(start + 1).is_some_and(|next| next.value == "(");
        let operator = words.get(1).is_some_and(|next| Operator::ALL.iter().any(|known| known.word() == next.value));
        if !is_label && (is_tag || is_call || operator) {
            return self.sum();
        }
        let (first, rest) = (first.value, text[first.value.len()..].trim());
        self.next += count;
        if let Ok(number) = first.parse::<Exact>()
            && number.is_finite()
            && tag.enum_labels.is_empty()
        {
            if !rest.is_empty() && units::of(rest) != tag.unit {
                let problem = self.problems.add(at, format!("`{rest}` is not the unit of {}", tag.name));
                problem.label(if tag.unit.is_empty() {
                    "it has none".into()
                } else {
                    format!("expected {}", tag.unit)
                });
                return None;
            }
            return Some(Expr::Number(number));
        }
        let choice = text.parse().map_or(Choice::Word(text), Choice::Number);
        exact_of(&At { value: choice, at }, tag, self.problems).map(Expr::Number)
    }
}

fn is_sign(word: &str) -> bool {
    ["(", ")", ","].contains(&word) || COMPARES.iter().any(|(sign, _)| *sign == word)
}

#[cfg(test)]
mod tests;
