//! The mimic of a plant file with made-up values, to see a picture while it is drawn.

use std::sync::Arc;

use ratatui::{Terminal, backend::TestBackend, buffer::Buffer};

use super::Mimic;
use crate::{
    access::SessionStatus,
    plant::{
        PlantDef,
        line_state::{DeviceState, LineState},
        sample::Sample,
        snapshot::Snapshot,
        tag::{Bound, Decimals, TagDef},
    },
    ui::{Clock, QueryNumbers, context::view_context, preferences::Preferences, tabs::TabView, theme::Theme},
};

/// Half seconds in which a made-up value goes once through its range.
const PERIOD: f64 = 120.0;
/// Half seconds for which a made-up state lasts.
const STATE: u32 = 16;

/// A page of the mimic at this size (columns, rows), `phase` half seconds after the start.
pub fn preview(def: &Arc<PlantDef>, page: usize, size: (u16, u16), phase: u32, theme: &Theme) -> Buffer {
    let mut snapshot = Snapshot::blank(Arc::clone(def));
    snapshot.lines.iter_mut().for_each(|line| line.state = LineState::Connected);
    snapshot.devices.iter_mut().for_each(|device| device.state = DeviceState::Responding);
    for (n, tag) in def.tags.iter().enumerate() {
        snapshot.samples[n] = Sample::good(made_up(tag, phase), snapshot.at);
        if let Decimals::Fixed(decimals) = tag.decimals {
            snapshot.decimals[n] = decimals;
        }
    }
    let mimic = Mimic { page, ..Mimic::default() };
    let mut backend = Terminal::new(TestBackend::new(size.0, size.1)).unwrap_or_else(|never| match never {});
    let (session, extension, preferences) = (SessionStatus::default(), None, Preferences::default());
    let numbers = QueryNumbers::default();
    let clock = Clock { phase, ..Clock::default() };
    let drawn = backend.draw(|frame| {
        let area = frame.area();
        let cx = view_context(&snapshot, (theme, &preferences), clock, area, &extension, (&session, &numbers));
        mimic.view(&cx, frame, area);
    });
    drawn.map(|frame| frame.buffer.clone()).unwrap_or_else(|never| match never {})
}

/// A value that moves through the range of its tag; a state that changes now and then.
fn made_up(tag: &TagDef, phase: u32) -> f64 {
    let (own, turn) = (f64::from(tag.id.0), phase / STATE + u32::from(tag.id.0));
    if !tag.enum_labels.is_empty() {
        return tag.enum_labels[turn as usize % tag.enum_labels.len()].0 as f64;
    }
    if tag.point.table.is_bits() {
        return f64::from(turn % 2);
    }
    let bound = |bound: Option<Bound>, usual: f64| match bound {
        Some(Bound::Fixed(value)) => value.near(),
        Some(Bound::From(_)) | None => usual,
    };
    let (min, max) = (bound(tag.min, 0.0), bound(tag.max, 100.0));
    let share = 0.5 + 0.45 * (f64::from(phase) * std::f64::consts::TAU / PERIOD + own).sin();
    min + (max - min) * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        profile::{self, Search},
        ui::{tests::text, widgets::text::take_overwritten},
    };

    #[test]
    fn every_shipped_picture_can_be_read_at_every_size() {
        for name in ["tank", "lab", "inverter"] {
            let plant = profile::load(std::path::Path::new(name), &Search::shipped()).expect("a shipped plant");
            for (columns, rows) in [(80, 18), (100, 30), (120, 34), (160, 44), (200, 54)] {
                take_overwritten();
                let drawn = text(&preview(&plant, 0, (columns, rows), 3, &Theme::FULL));
                assert!(!drawn.contains("##") && drawn.contains('┌'), "{name} at {columns}x{rows}:\n{drawn}");
                assert_eq!(take_overwritten(), [""; 0], "{name} at {columns}x{rows}:\n{drawn}");
            }
        }
    }

    #[test]
    fn made_up_values_stay_in_their_range_and_move() {
        let plant = profile::load(std::path::Path::new("tank"), &Search::shipped()).expect("a shipped plant");
        let level = plant.tags.iter().find(|tag| tag.name == "PLC-1.LT-1").expect("a level");
        let values: Vec<f64> = (0..240).map(|phase| made_up(level, phase)).collect();
        let (Some(Bound::Fixed(min)), Some(Bound::Fixed(max))) = (level.min, level.max) else { panic!("{level:?}") };
        let [min, max] = [min, max].map(crate::plant::exact::Exact::near);
        assert!(values.iter().all(|value| (min..=max).contains(value)), "{values:?}");
        assert!(values.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
