//! The tables of a report about alarms.

use super::minutes;
use crate::{
    plant::{def::Priority, record::AlarmRecord},
    report::{
        ShiftReport, SuppressedSummary,
        alarm_metrics::{BadActor, Row},
        document::{Cell, Column, Table},
        raised,
    },
    text::translate,
};

pub(super) fn alarm_counts(report: &ShiftReport) -> Table {
    let columns = [Column::text("priority"), Column::number("raised"), Column::number("raised while suppressed")];
    Table::new(columns).with(Priority::ALL.into_iter().map(|priority| {
        let suppressed = report.suppressed.iter().filter(|alarm| alarm.priority == priority);
        let suppressed: u64 = suppressed.map(|alarm| alarm.raised).sum();
        let suppressed = Cell::number(Some(suppressed as f64), 0);
        vec![Cell::text(translate(priority.word())), Cell::count(raised(&report.alarms, priority)), suppressed]
    }))
}

pub(super) fn suppressed(alarms: &[SuppressedSummary]) -> Table {
    let columns = [
        Column::text("priority"),
        Column::text("subject"),
        Column::text("alarm"),
        Column::number("raised"),
        Column::number("minutes active"),
    ];
    Table::new(columns).with(alarms.iter().map(|alarm| {
        vec![
            Cell::text(translate(alarm.priority.word())),
            Cell::text(&alarm.subject),
            Cell::text(translate(&alarm.message)),
            Cell::number(Some(alarm.raised as f64), 0),
            minutes(alarm.active),
        ]
    }))
}

pub(super) fn metrics(rows: &[Row]) -> Table {
    let columns = [
        Column::text("metric"),
        Column::number("value"),
        Column::text("target"),
        Column::text("limit"),
        Column::text("result"),
    ];
    Table::new(columns).with(rows.iter().map(|row| {
        vec![
            Cell::text(translate(row.measure)),
            Cell::number(row.value, row.decimals),
            Cell::text(&row.target),
            Cell::text(&row.limit),
            Cell::text(translate(row.result)),
        ]
    }))
}

pub(super) fn bad_actors(alarms: &[BadActor]) -> Table {
    let columns = [Column::text("kind"), Column::text("subject"), Column::text("alarm"), Column::number("raised")];
    Table::new(columns).with(alarms.iter().map(|alarm| {
        let raised = Cell::number(alarm.raised.map(|raised| raised as f64), 0);
        vec![Cell::text(translate(alarm.kind)), Cell::text(&alarm.subject), Cell::text(translate(&alarm.alarm)), raised]
    }))
}

pub(super) fn alarms(alarms: &[AlarmRecord]) -> Table {
    let columns = [
        Column::milliseconds("time"),
        Column::text("priority"),
        Column::text("subject"),
        Column::text("alarm"),
        Column::text("event"),
        Column::number("value"),
        Column::number("limit"),
        Column::text("by"),
        Column::text("reason"),
    ];
    let annunciated = alarms.iter().filter(|alarm| !alarm.event.is_quiet());
    Table::new(columns).with(annunciated.map(|alarm| {
        vec![
            Cell::Time(alarm.at),
            Cell::text(translate(alarm.priority.word())),
            Cell::text(&alarm.subject),
            Cell::text(translate(&alarm.message)),
            Cell::text(translate(alarm.event.word())),
            Cell::shortest(alarm.value),
            Cell::shortest(alarm.limit),
            Cell::text(alarm.by.as_deref().unwrap_or("")),
            Cell::text(alarm.reason.as_deref().unwrap_or("")),
        ]
    }))
}
