//! Where a tag lies: table, address, type and bits of a row, against each other and against its device.

use super::{DeviceContext, NOWHERE, Raws, bits::bit_field};
use crate::{
    plant::{
        def::Limits,
        tag::{DataType, Point, Table},
    },
    profile::{
        address::{Location, check_modicon, locate},
        diagnostic::{Problems, Span},
        reader::{At, Choice, OptionalKey},
        schema::TagTable,
        tag_keys::{check_calculated, check_text},
    },
};

/// Where it lies, its raw numbers, and whether it is a text.
pub(super) fn place(
    row: &TagTable,
    context: &DeviceContext,
    problems: &mut Problems,
) -> (Option<Point>, Option<Raws>, bool) {
    if let Some(expr) = &row.expr {
        check_calculated(row, expr.at, problems);
    }
    let point = point(row, context, problems);
    let kind = point.filter(|_| row.expr.is_none()).map(|point| (point.kind, point.field.map(|(_, bits)| bits)));
    let is_text = point.is_some_and(|point| point.kind.is_text());
    if let Some(point) = point.filter(|_| is_text) {
        check_text(row, point, problems);
    }
    (point, kind, is_text)
}

fn point(row: &TagTable, context: &DeviceContext, problems: &mut Problems) -> Option<Point> {
    if row.expr.is_some() {
        return Some(Point { kind: DataType::F64, ..NOWHERE });
    }
    if row.address.is_none() && row.valid {
        problems.add(row.at, "a tag needs `address`").label("missing here").help("or `expr`, if it is calculated");
    }
    let location = row.address.as_ref().filter(|_| row.valid)?;
    let (named, address) = locate(location, context.scheme, problems)?;
    let is_stated = matches!(location.value, Location::In(..));
    let table = table(row, named, is_stated, problems)?;
    if let Some(modicon) = &row.modicon {
        check_modicon(modicon, table, address, problems);
    }
    let kind = match (row.kind, table.is_bits()) {
        (Some(kind), true) if kind.value.0 != DataType::Bool => {
            problems.add(kind.at, format!("a {} is one bit", table.word())).label("expected type = \"bool\"");
            return None;
        }
        (None, true) => DataType::Bool,
        (Some(kind), _) => kind.value.0,
        (None, false) => {
            problems
                .add(row.at, "a tag in a register needs `type`")
                .label("missing here")
                .help("for example type = \"int16\"");
            return None;
        }
    };
    let field = match &row.field {
        Some(field) => Some(bit_field(field, (kind, row.kind.map(|kind| kind.at)), table, problems)?),
        None => None,
    };
    let point = Point { table, address, kind, order: row.order.value_or(Default::default()), field };
    check_place(point, location.at, context.limits, problems).then_some(point)
}

fn table(row: &TagTable, named: Option<Table>, is_stated: bool, problems: &mut Problems) -> Option<Table> {
    match (row.table, named) {
        // V memory answers to both register functions, so the table may be named for it.
        (Some(written), Some(Table::Holding)) if !is_stated && !written.value.is_bits() => Some(written.value),
        (Some(written), Some(named)) if written.value != named => {
            let problem =
                problems.add(written.at, format!("this address is a {}, not a {}", named.word(), written.value.word()));
            problem.label("leave it out: the address defines it");
            None
        }
        (Some(written), _) => Some(written.value),
        (None, Some(named)) => Some(named),
        (None, None) => {
            problems.add(row.at, "a tag needs `table`").label("missing here").help("coil, discrete, input or holding");
            None
        }
    }
}

/// Checks that the registers exist, fit into one request and lie where the device wants them.
fn check_place(point: Point, at: Span, limits: Limits, problems: &mut Problems) -> bool {
    let words = point.len();
    if u32::from(point.address) + u32::from(words) > 0x1_0000 {
        problems.add(at, "the value extends past the last address").label("the last is 65535");
        return false;
    }
    let (alignment, max) = (limits.step(point.table), limits.most(point.table));
    if words > 1 && !point.address.is_multiple_of(alignment) {
        let problem = problems.add(
            at,
            format!("a value of {words} registers at address {} breaks alignment = {alignment}", point.address),
        );
        problem.label(format!("expected a multiple of {alignment}"));
    }
    if !point.table.is_bits() && words > max {
        problems
            .add(at, format!("the value takes {words} registers, the device reads at most {max}"))
            .label("too long");
    }
    true
}

/// Bits inside the word of another tag.
pub(in crate::profile) fn field_of(field: &At<Choice>, point: Point, problems: &mut Problems) -> Option<(u8, u8)> {
    bit_field(field, (point.kind, None), point.table, problems)
}
