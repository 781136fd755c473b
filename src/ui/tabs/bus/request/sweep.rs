//! The fields of a sweep, and what it will cost.

use super::{fields::address, *};
use crate::plant::sweep::{EVERY_USUAL, Sweep};

/// Of the form of a sweep.
pub(super) fn fields(unit: Field) -> Vec<Field> {
    let choice = |label, options: Vec<String>| Field { label, input: Input::Choice(options, 0), range: String::new() };
    let typed = |label, text: &str| Field {
        label,
        input: Input::Text(Line::long(text, 400)),
        range: t!("on the wire, from 0; or a Modicon number").to_owned(),
    };
    let depth = [t!("ranges of 8 addresses or more"), t!("every address")];
    vec![
        unit,
        choice(t!("table"), TABLES.map(|table| translate(table.word()).to_owned()).to_vec()),
        typed(t!("from"), "0"),
        typed(t!("to"), "0xFFFF"),
        choice(t!("find"), depth.map(str::to_owned).to_vec()),
    ]
}

/// Opens the form for all of a table, or says why not.
pub fn ask_sweep(cx: &ViewContext, line: LineId, unit: u8, table: Table) -> Vec<UiAction> {
    let Some(at) = LineView::new(cx, line) else { return Vec::new() };
    let kind = CommandKind::Test(line, Diagnostic::Identify { unit });
    let form = Form::sweep(cx, &at, unit, table);
    vec![Notice::or(cx, t!("map of addresses"), &kind, Modal::Bus(Box::new(Window::Form(form))))]
}

impl Form {
    fn sweep(cx: &ViewContext, at: &LineView, unit: u8, table: Table) -> Form {
        let mut form = Form::new(cx, at, Tried::Sweep);
        form.fields[0].input = Input::Text(Line::long(&unit.to_string(), 400));
        if let Input::Choice(_, chosen) = &mut form.fields[1].input {
            *chosen = TABLES.iter().position(|known| *known == table).unwrap_or(0);
        }
        form
    }

    pub(super) fn build_sweep(&self, unit: u8) -> Result<Built, String> {
        let table = TABLES[self.chosen(1)];
        let end = |n: usize| address(&self.text(n), table);
        let every = if self.chosen(4) == 0 { EVERY_USUAL } else { 1 };
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
