//! Columns that can mean several things, each of which makes other values of them: their reader says which.

use super::{
    cells::Cells,
    columns::Column,
    factors::{effect, is_close, is_kind_of_format, is_pattern},
    headings::Heading,
    meanings::{is_blank, share},
    neighbours::is_fixed_type,
    words::{bit_field_of, is_marked, kind_of, number_of, power_of_ten},
};
use crate::{t, text::translate};

/// A column of which it is not known what it means.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Its place.
    pub place: usize,
    /// What it is called.
    pub heading: String,
    /// What it can mean.
    pub may_be: Vec<Column>,
    /// What stands in it, once.
    pub example: String,
}

impl Question {
    /// `Ratio (10): factor or divisor?`
    pub fn words(&self) -> String {
        let all: Vec<&str> = self.may_be.iter().map(|column| translate(column.word())).collect();
        let meanings = all.join(" / ");
        t!("{heading} ({example}): {meanings}?", heading = self.heading, example = self.example, meanings)
    }

    /// Why a row with this cell is left out.
    pub fn of_cell(&self, cell: &str) -> String {
        Question { example: cell.to_owned(), ..self.clone() }.words()
    }

    /// Does this cell make another value of its row in one meaning than in another?
    pub fn matters(&self, cell: &str) -> bool {
        let effects: Vec<Option<f64>> = self.may_be.iter().map(|column| effect(*column, cell)).collect();
        let is_same = effects.iter().all(|effect| effect.is_some() && *effect == effects[0]);
        let changes_nothing = is_same && effects[0].is_some_and(|effect| 1 < effects.len() || effect == 1.0);
        let is_none = is_blank(cell) || Heading::new(&self.heading).is_format() && is_kind_of_format(cell);
        !changes_nothing && !is_none
    }
}

/// The questions that columns leave open, unless their reader has answered them.
pub fn of(
    means: &mut [Option<Column>],
    headings: &[String],
    (rows, cells): (&[Cells], &[Vec<&str>]),
    is_said: impl Fn(usize) -> bool,
) -> Vec<Question> {
    let has = |wanted: &[Column]| means.iter().flatten().any(|column| wanted.contains(column));
    let is_scaled = has(&[Column::Scale, Column::Divisor, Column::Exponent, Column::Places]);
    let is_typed = has(&[Column::Type]);
    let kinds: Vec<&str> = means
        .iter()
        .zip(cells)
        .filter(|(means, _)| **means == Some(Column::Type))
        .flat_map(|(_, cells)| cells.clone())
        .collect();
    let may_be = |n: usize| -> Vec<Column> {
        let (heading, cells) = (Heading::new(&headings[n]), &cells[n]);
        match means[n] {
            Some(Column::Scale) => of_factor(&heading, cells),
            Some(Column::Exponent) if !heading.is_power() && !plain(cells).any(|number| number <= 0.0) => {
                vec![Column::Exponent, Column::Divisor, Column::Scale]
            }
            // A pattern may as well say how a number with a point is shown.
            Some(Column::Places) if cells.iter().any(|cell| is_pattern(cell)) => vec![Column::Places, Column::Decimals],
            Some(Column::Divisor) if plain(cells).any(|number| number.abs() < 1.0) => {
                vec![Column::Divisor, Column::Scale]
            }
            Some(Column::Table)
                if !heading.has(&["function", "fc", "code", "funktion", "funktionscode"]) && is_digit(cells) =>
            {
                vec![Column::Table, Column::Area]
            }
            // The sixteenth of bits that count from 1, or of more than a register.
            Some(Column::Field)
                if cells.contains(&"16")
                    && !cells.iter().any(|cell| bit_field_of(cell).is_some_and(|(low, _)| low == 0)) =>
            {
                vec![Column::Field]
            }
            Some(Column::Offset) if is_rising(cells) => vec![Column::Offset],
            Some(Column::Length) if is_of_bytes(&heading, &kinds) => vec![Column::Length, Column::Bytes],
            Some(Column::Address) if is_half_hex(cells) => {
                vec![Column::Address, Column::HexAddress]
            }
            None | Some(Column::Decimals) if heading.is_places() && !is_scaled && is_places(cells) => {
                vec![Column::Places, Column::Decimals]
            }
            None if heading.is_harmless() || cells.is_empty() => Vec::new(),
            None if !is_typed && 60 <= share(cells, |cell| kind_of(cell).is_some()) => vec![Column::Type],
            None if is_scaled && heading.is_accuracy() => Vec::new(),
            None if is_of_factors(cells) => vec![Column::Scale, Column::Divisor],
            None | Some(_) => Vec::new(),
        }
    };
    let open: Vec<Question> = (0..means.len())
        .filter(|n| !is_said(*n))
        .filter_map(|n| {
            let may_be = may_be(n);
            let question = |may_be| Question { place: n, heading: headings[n].clone(), may_be, example: String::new() };
            let question = Some(question(may_be)).filter(|question| !question.may_be.is_empty())?;
            let example = cells[n].iter().find(|cell| question.matters(cell))?;
            Some(Question { example: (*example).to_owned(), ..question })
        })
        .collect();
    settle(open, means, rows)
}

/// Answers the questions that other columns answer, and leaves open what the others ask about.
fn settle(open: Vec<Question>, means: &mut [Option<Column>], rows: &[Cells]) -> Vec<Question> {
    let sure = |n: &usize| open.iter().all(|question| question.place != *n);
    let sure: Vec<usize> = (0..means.len()).filter(sure).collect();
    let proved: Vec<Option<Column>> = open.iter().map(|question| proved(question, &sure, means, rows)).collect();
    open.iter().zip(&proved).for_each(|(question, proved)| means[question.place] = *proved);
    open.into_iter().zip(proved).filter(|(_, proved)| proved.is_none()).map(|(question, _)| question).collect()
}

/// The meaning in which a column says the same factors as one that is sure, in each row: 10 divides beside 0.1.
fn proved(question: &Question, sure: &[usize], means: &[Option<Column>], rows: &[Cells]) -> Option<Column> {
    let is_factor =
        |column: &Column| matches!(column, Column::Scale | Column::Divisor | Column::Exponent | Column::Places);
    let says_same = |means: Column, (place, other): (usize, Column)| {
        let both = rows.iter().filter_map(|row| {
            let cell = row.cells.get(question.place).filter(|cell| question.matters(cell))?;
            Some((effect(means, cell)?, effect(other, row.cells.get(place)?)))
        });
        let both: Vec<(f64, Option<f64>)> = both.collect();
        !both.is_empty() && both.iter().all(|(one, other)| other.is_some_and(|other| is_close(*one, other)))
    };
    let others = || sure.iter().filter_map(|n| Some((*n, means[*n].filter(is_factor)?)));
    let may_be = question.may_be.iter().copied().filter(is_factor);
    may_be.into_iter().find(|means| others().any(|other| says_same(*means, other)))
}

/// The numbers that do not say themselves whether they multiply or divide.
fn plain<'a>(cells: &'a [&str]) -> impl Iterator<Item = f64> + 'a {
    cells.iter().filter(|cell| !is_marked(cell)).filter_map(|cell| number_of(cell))
}

/// Whole numbers around 0 as factors are powers of ten as well; those above 1 may be what a maker has multiplied by.
fn of_factor(heading: &Heading, cells: &[&str]) -> Vec<Column> {
    let whole: Option<Vec<i8>> = cells.iter().map(|cell| cell.parse().ok()).collect();
    if whole.is_some_and(|numbers| numbers.iter().any(|number| *number <= 0)) {
        return vec![Column::Scale, Column::Exponent];
    }
    let is_above = plain(cells).any(|number| 1.0 < number.abs());
    // A maker has called 10 and 0.1 so that a value is divided by.
    let is_other = heading.is_scale_factor() && plain(cells).any(|number| number != 1.0);
    if is_other || is_above && !heading.is_multiplier() { vec![Column::Scale, Column::Divisor] } else { Vec::new() }
}

/// Factors stand in few other columns: with decimals, or powers of ten.
fn is_of_factors(cells: &[&str]) -> bool {
    let is_power = |number: f64| number == 1.0 || (-9..=9).any(|n| number == power_of_ten(f64::from(n)));
    let fits = |cell: &str| {
        let number = number_of(cell.trim_end_matches('%'));
        number.is_some_and(|number| number.fract() != 0.0 || is_power(number) || is_marked(cell))
    };
    80 <= share(cells, fits)
}

/// `3` and `4`: function codes or areas.
fn is_digit(cells: &[&str]) -> bool {
    cells.iter().any(|cell| matches!(*cell, "0" | "1" | "2" | "3" | "4"))
}

/// Does it rise from row to row, perhaps again from 0? It may count something, and not be added.
fn is_rising(cells: &[&str]) -> bool {
    let numbers: Vec<f64> = cells.iter().filter_map(|cell| number_of(cell)).collect();
    let is_step = |pair: &[f64]| pair[0] < pair[1] || pair[1] == 0.0 && pair[0] != 0.0;
    numbers.windows(2).all(is_step) && numbers.windows(2).any(|pair| pair[0] < pair[1])
}

/// Lengths of which nothing shows whether they count registers: neither their heading nor a type with its size.
fn is_of_bytes(heading: &Heading, kinds: &[&str]) -> bool {
    let is_stated =
        heading.has(&["registers", "register", "words", "wörter", "quantity", "qty", "count", "registeranzahl"]);
    !is_stated && !kinds.iter().any(|kind| is_fixed_type(kind))
}

/// Some of its cells may be hexadecimal numbers; a single word such as `AC` stands above others.
fn is_half_hex(cells: &[&str]) -> bool {
    let has_digit = |cell: &&str| is_of_letters(cell) && cell.bytes().any(|byte| byte.is_ascii_digit());
    cells.iter().any(has_digit) || 20 <= share(cells, is_of_letters) && !cells.is_empty()
}

/// `A0`, which may be a number or a name.
fn is_of_letters(cell: &str) -> bool {
    (2..=4).contains(&cell.len())
        && cell.bytes().all(|byte| byte.is_ascii_hexdigit())
        && cell.bytes().any(|byte| byte.is_ascii_alphabetic())
}

fn is_places(cells: &[&str]) -> bool {
    !cells.is_empty() && 50 <= share(cells, |cell| cell.parse::<u8>().is_ok_and(|places| places <= 6))
}
