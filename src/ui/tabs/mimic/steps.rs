//! Where sequences and programs are, and how much of the step is left, where that is known.

use super::{attention::AttentionRow, forecast::left_in_step};
use crate::plant::program::ProgramPosition;
use crate::ui::tabs::{controllers::program, prelude::*};

/// Each sequence with its chain of steps, and each program that is under way.
pub fn rows(cx: &ViewContext) -> Vec<AttentionRow> {
    let def = cx.def();
    let sequences = def.logic.sequences.iter().flat_map(|sequence| {
        let now = cx.snapshot.sample(sequence.step).good_value();
        let mark = |(number, name): &(i128, String)| {
            let name = of_plant(name);
            let is_now = now == Some(*number as f64);
            if is_now { format!("{}{name}", cx.theme.pick("▸", ">")) } else { name.to_lowercase() }
        };
        let chain: Vec<String> = def.tag(sequence.step).enum_labels.iter().map(mark).collect();
        let (name, shown) = (&def.tag(sequence.step).name, value::show(cx, sequence.step));
        let left = left_in_step(cx, sequence.step);
        let words = match (now, left) {
            (Some(_), Some(left)) => t!("{step}, {left} left", step = shown.text, left = running(left)),
            (Some(_), None) => shown.text.clone(),
            (None, _) => shown.whole(),
        };
        let style = if now.is_some() { cx.theme.strong() } else { shown.style };
        let chain = (!chain.is_empty()).then(|| (chain.join(" - "), cx.theme.normal()));
        std::iter::once((format!("{name}: {words}"), style)).chain(chain)
    });
    let programs = def.devices.iter().filter_map(|device| {
        let program = device.program.as_ref()?;
        let place = cx.snapshot.sample(program.position).good_value().map(|position| program.place(position))?;
        let runs = match place {
            ProgramPosition::Ramp(_) | ProgramPosition::Soak(_) => true,
            ProgramPosition::Off | ProgramPosition::Ended => false,
        };
        runs.then(|| (format!("{}: {}", device.name, program::now_text(cx, device, program)), cx.theme.strong()))
    });
    sequences.chain(programs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::sample::{Cause, Sample},
        ui::fixture::{Fixture, now, with_cx},
    };

    #[test]
    fn the_chain_of_steps_says_where_it_is_and_what_is_left() {
        let said = |fixture: &Fixture| -> Vec<String> {
            with_cx(&fixture.snapshot(), rows).into_iter().map(|(text, _)| text).collect()
        };
        let mut fixture = Fixture::normal();
        assert_eq!(
            said(&fixture),
            ["PLC-1.STEP: HEAT, 03:12 left", "idle - fill - ▸HEAT - hold - drain - cool - return"]
        );
        fixture.set("PLC-1.LEFT", 0.0);
        assert_eq!(said(&fixture)[0], "PLC-1.STEP: HEAT", "a step without a time");
        let step = fixture.tag("PLC-1.STEP");
        fixture.samples[step.index()] = Sample::bad(Cause::Timeout, now());
        let shown = said(&fixture);
        assert!(shown[0].contains("----") && !shown[1].contains('▸'), "{shown:?}");
    }
}
