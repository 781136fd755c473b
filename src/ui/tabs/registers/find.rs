//! Where something is: an address as it is typed, and a value among what was read.

use super::{Registers, view};
use crate::{
    plant::{
        address::{AddressBase, AddressContext},
        live::number,
        tag::Table,
    },
    t,
};

impl Registers {
    /// `1002`, `0x3EA`, `41003`: in this table and by its base; `input:1000`: as sent, in any.
    pub(super) fn parse_address(&self, text: &str) -> Result<(Table, u16), String> {
        let of = AddressContext { table: self.table, is_stated: false, base: self.base };
        of.parse(text).ok_or_else(|| {
            if self.base == AddressBase::One && number(text) == Some(0) {
                return t!("the first is 1").to_owned();
            }
            t!("found `{text}`, expected an address such as 1002, 0x3EA, 41003 or holding:1002", text)
        })
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
