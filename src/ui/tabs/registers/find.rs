//! Where something is: an address as it is typed, and a value among what was read.

use super::{Base, Registers, view};
use crate::{
    plant::{
        live::{AddressSpan, number, of_modicon},
        tag::Table,
    },
    t,
};

impl Registers {
    /// `1002`, `0x3EA`: in this table, by its base; `41003`, `input:1000`: in any.
    pub(super) fn parse_address(&self, text: &str) -> Result<(Table, u16), String> {
        if let Some(modicon) = of_modicon(text) {
            return Ok(modicon);
        }
        match (number(text), self.base) {
            (Some(address), Base::One) if !text.starts_with("0x") => address
                .checked_sub(1)
                .map(|address| (self.table, address))
                .ok_or_else(|| t!("the first is 1").to_owned()),
            (Some(address), _) => Ok((self.table, address)),
            (None, _) => text.parse::<AddressSpan>().map(|span| (span.table, span.address)),
        }
    }

    /// The next address behind the selected one that holds a value, alone or with those that follow it, raw or with one
    /// to three decimals.
    pub(super) fn find(&self, text: &str) -> Result<(Table, u16), String> {
        let wrong = || t!("found `{text}`, expected a number such as 702, 70.2 or 0x2BE", text);
        let wanted = match number(text) {
            Some(word) => f64::from(word),
            None => text.parse::<f64>().ok().filter(|wanted| wanted.is_finite()).ok_or_else(wrong)?,
        };
        let holds = |(table, address): &(Table, u16)| {
            view::meanings(&self.cells.words(*table, *address, 4), self.order).iter().any(|value| {
                // As exact as it was typed.
                let digit = 0.5 * 10f64.powi(-to_i32(text.split_once('.').map_or(0, |(_, digits)| digits.len())));
                (0..=3).any(|decimals| {
                    (value / 10f64.powi(decimals) - wanted).abs() < digit * 1e-6 + f64::EPSILON * wanted.abs()
                }) || (value.fract() != 0.0 && (value - wanted).abs() <= digit)
            })
        };
        let here = (self.table, self.selected);
        let good: Vec<(Table, u16)> = self.cells.good().collect();
        let behind = good.iter().filter(|at| here < **at);
        let around = behind.chain(good.iter().filter(|at| **at <= here));
        around.copied().find(holds).ok_or_else(|| t!("{text} is in none of the registers read so far", text))
    }
}

fn to_i32(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX)
}
