//! Alarms that are suggested for a new plant file: by its profiles, and by what was read.

use super::new_plant::{NewAlarm, is_fast};
use crate::plant::{
    id::TagId,
    tag::{Access, Bound, TagDef},
};

/// Values with limits beyond what was read, at most.
const PLAUSIBLE_MAX: usize = 6;
/// So far beyond the greatest and least value that was read.
const MARGIN: f64 = 0.2;
/// Units of what is measured, not counted or set.
const MEASURED: [&str; 20] = [
    "°C", "°F", "K", "bar", "mbar", "kPa", "MPa", "Pa", "psi", "V", "kV", "A", "W", "kW", "Hz", "l/min", "m³/h",
    "% RH", "ppm", "rpm",
];

/// Why an alarm is suggested.
#[derive(Clone, Copy)]
enum Suggestion {
    /// A fault word is more than 0.
    Fault,
    /// The upper end of a measured range.
    High,
    /// The lower end.
    Low,
}

/// Alarms that a profile suggests for these of its tags: a fault word that is not 0, and the ends of a measured range.
pub fn suggested_alarms(device: &str, tags: &[TagDef]) -> Vec<NewAlarm> {
    let faults = tags.iter().filter_map(|tag| tag.quality_from.map(|(fault, _)| fault));
    let faults: Vec<TagId> = faults.collect();
    let alarm = |tag: &TagDef, kind: Suggestion, limit, deadband, reason| {
        let words = if tag.label.is_empty() { &tag.short } else { &tag.label };
        let (condition, message) = match kind {
            Suggestion::Fault => ("high", words.clone()),
            Suggestion::High => ("high", format!("{words} high")),
            Suggestion::Low => ("low", format!("{words} low")),
        };
        let cause = tag.bit_labels.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>().join(", or ");
        NewAlarm { tag: format!("{device}.{}", tag.short), condition, limit, deadband, message, reason, cause }
    };
    tags.iter()
        .filter(|tag| tag.access == Access::Read && tag.enum_labels.is_empty() && !tag.is_text())
        .flat_map(|tag| {
            let fault = faults
                .contains(&tag.id)
                .then(|| alarm(tag, Suggestion::Fault, 0.5, 0.25, "The word is 0 while all is well"));
            // An output cannot leave 0 to 100 %.
            let limits = match (tag.min, tag.max) {
                (Some(Bound::Fixed(min)), Some(Bound::Fixed(max)))
                    if is_fast(tag) && !tag.unit.is_empty() && tag.unit != "%" =>
                {
                    let reason = "The end of the range that the profile gives";
                    let deadband = (max - min).near() / 100.0;
                    let low = (min != 0.0).then(|| alarm(tag, Suggestion::Low, min.near(), deadband, reason));
                    [Some(alarm(tag, Suggestion::High, max.near(), deadband, reason)), low]
                }
                _ => [None, None],
            };
            fault.into_iter().chain(limits.into_iter().flatten()).collect::<Vec<_>>()
        })
        .collect()
}

/// Limits beyond what was read of values in units of what is measured: least and greatest so far.
pub fn plausible_alarms(device: &str, tags: &[TagDef], seen: &dyn Fn(&TagDef) -> Option<(f64, f64)>) -> Vec<NewAlarm> {
    let is_measured = |tag: &&TagDef| tag.access == Access::Read && MEASURED.contains(&tag.unit.as_str());
    let limits = |tag: &TagDef| {
        let (low, high) = seen(tag).filter(|(low, high)| low.is_finite() && high.is_finite())?;
        let margin = (MARGIN * low.abs().max(high.abs())).max(2.0 * (high - low));
        if margin == 0.0 {
            return None;
        }
        // In three digits, as a person would write it.
        let rounded = |limit: f64| format!("{limit:.2e}").parse().unwrap_or(limit);
        let alarm = |condition, limit: f64, word: &str| NewAlarm {
            tag: format!("{device}.{}", tag.short),
            condition,
            limit: rounded(limit),
            deadband: rounded(margin / 10.0),
            message: format!("{} {word}", tag.short),
            reason: "Beyond what was read when this file was made",
            cause: String::new(),
        };
        let below = (0.0 < low).then(|| alarm("low", low - margin, "low"));
        Some([Some(alarm("high", high + margin, "high")), below].into_iter().flatten().collect::<Vec<_>>())
    };
    tags.iter().filter(is_measured).filter_map(limits).take(PLAUSIBLE_MAX).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        id::DeviceId,
        tag::{ByteOrder, DataType, Point, Table},
    };

    #[test]
    fn limits_lie_beyond_what_was_read_of_measured_values() {
        let point =
            Point { table: Table::Holding, address: 0, kind: DataType::U16, order: ByteOrder::Abcd, field: None };
        let tag =
            |name: &str, unit: &str| TagDef { unit: unit.into(), ..TagDef::new(TagId(0), DeviceId(0), name, point) };
        let tags = [tag("T", "°C"), tag("E", "kWh"), tag("P", "bar"), tag("Z", "V")];
        let seen = |tag: &TagDef| match tag.short.as_str() {
            "T" => Some((60.0, 70.0)),
            "P" => Some((-1.0, -1.0)),
            "Z" => Some((0.0, 0.0)),
            _ => Some((1.0, 2.0)),
        };
        let found: Vec<(String, &str, f64)> = plausible_alarms("D", &tags, &seen)
            .into_iter()
            .map(|alarm| (alarm.tag, alarm.condition, alarm.limit))
            .collect();
        let expect = [("D.T", "high", 90.0), ("D.T", "low", 40.0), ("D.P", "high", -0.8)];
        assert_eq!(found, expect.map(|(tag, condition, limit)| (tag.to_owned(), condition, limit)));
    }
}
