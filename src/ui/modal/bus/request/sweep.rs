//! The fields of a sweep, and what it will cost.

use super::{fields::address, *};
use crate::plant::sweep::{EVERY_USUAL, Sweep};

pub(super) fn fields(unit: Field) -> Vec<Field> {
    let typed = |label, text: &str| typed(label, text, t!("on the wire, from 0; or a Modicon number"));
    let depth = [t!("ranges of 8 addresses or more"), t!("every address")];
    vec![
        unit,
        table_field(Table::Holding),
        typed(t!("from"), "0"),
        typed(t!("to"), "0xFFFF"),
        Field::choice(t!("find"), depth, 0),
    ]
}

fn table_field(table: Table) -> Field {
    Field::one_of(t!("table"), &TABLES, table, |table| translate(table.word()))
}

/// Opens the form for all of a table, or says why not.
pub fn ask_sweep(cx: &ViewContext, line: LineId, unit: u8, table: Table) -> Vec<UiAction> {
    let Some(at) = LineView::new(cx, line) else { return Vec::new() };
    let kind = CommandKind::Test(line, Diagnostic::Identify { unit });
    let form = RequestForm::sweep(cx, &at, unit, table);
    vec![Notice::or(cx, t!("map of addresses"), &kind, Modal::Bus(Box::new(Window::Form(form))))]
}

impl RequestForm {
    fn sweep(cx: &ViewContext, at: &LineView, unit: u8, table: Table) -> RequestForm {
        let mut form = RequestForm::new(cx, at, TestKind::Sweep);
        form.form.replace(0, typed(t!("unit"), &unit.to_string(), ""));
        form.form.replace(1, table_field(table));
        form
    }

    pub(super) fn build_sweep(&self, unit: u8) -> Result<Built, String> {
        let table = TABLES[self.form.chosen(1)];
        let end = |n: usize| address(&self.form.text(n), table);
        let every = if self.form.chosen(4) == 0 { EVERY_USUAL } else { 1 };
        let sweep = Sweep { unit, table, first: end(2)?, last: end(3)?, every };
        let diagnostic = Diagnostic::Sweep(sweep);
        diagnostic.check()?;
        let (answered, refused) = sweep.requests();
        let words = t!(
            "reads only: {answered} requests if every address answers, about {refused} if none does. Polls keep their time.",
            answered,
            refused = answered + refused
        );
        Ok((diagnostic, vec![words]))
    }
}
