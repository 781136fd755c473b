//! What the words of a controller mean, and what to change when it does not do what it should: pages to read.

use crate::ui::tabs::prelude::*;

/// A page: its heading and its lines, at most 16 of at most 76 columns.
type Page = (&'static str, &'static [&'static str]);

/// The pages.
pub const PAGES: &[Page] = &[
    (
        "P, I and D",
        &[
            "PV is what is measured, SV what is wanted, MV how much power is given, in %.",
            "",
            "P  proportional band, in % of the measuring range. Inside the band below SV",
            "   the power falls from 100 % to 0 %. A small P reacts strongly and may",
            "   swing; a large P reacts softly and is slow. P alone stops below SV,",
            "   where the power left just covers the losses: a lasting deviation.",
            "I  integral time, in seconds. Adds power for as long as PV is below SV, so",
            "   that the lasting deviation goes. A small I works fast and may overshoot",
            "   or swing; a large I is slow. 0 switches it off.",
            "D  derivative time, in seconds. Takes power back while PV rises fast, so",
            "   that it does not shoot over SV. Too large a D makes MV restless,",
            "   because it answers every tremble of the sensor. 0 switches it off.",
            "",
            "With P = 0 the controller only switches on and off: see the next page.",
        ],
    ),
    (
        "kinds of control",
        &[
            "on/off  P = 0. Full power below SV, none above. PV swings all the time by",
            "        hysteresis and delay. For simple heaters; wears out relays.",
            "P       I = 0 and D = 0. Calm, but stays below SV for good.",
            "PI      D = 0. Reaches SV and stays there. Right for most flows and",
            "        pressures, and for slow heaters without overshoot.",
            "PD      I = 0. Fast and without overshoot, but stays below SV for good.",
            "PID     Reaches SV, stays, and answers disturbances fast. The usual choice",
            "        for temperature, if P, I and D fit the process: see auto-tuning.",
            "fuzzy   PID whose strength follows rules: full power for long, then early",
            "        restraint. Reaches SV soonest with little overshoot; the P, I and",
            "        D of auto-tuning are its basis.",
            "self-   Finds P, I and D by itself again when SV changes or the process",
            "tuning  swings. For plants that change; not for those that others disturb,",
            "        because it takes their disturbance for the process.",
        ],
    ),
    (
        "auto-tuning",
        &[
            "The controller switches the output fully on and off around SV, watches two",
            "swings of PV, and computes P, I and D from their size and period.",
            "",
            "before  Set the SV that you will work with, and the load that is usual.",
            "        Make sure that swings of some degrees harm nothing.",
            "start   T on the page of the device. \"low PV\" tunes 10 % below SV, where",
            "        an overshoot above SV must not happen.",
            "during  The page tells the time, the swings, and how long one takes. Do not",
            "        change SV, and open no doors or valves. T again stops it; P, I and",
            "        D then stay as they were.",
            "after   The page shows P, I and D before and after. Write down the old",
            "        ones, or save a parameter set before you start (s, then n).",
            "        Nothing found after some hours: the heater is too weak, or SV",
            "        cannot be reached.",
            "keep    FIX saves them in the controller's own memory, else a power cut",
            "        brings the old ones back.",
        ],
    ),
    (
        "when it does not do what it should",
        &[
            "Change one value at a time, by a half or to the double, and wait for the",
            "next swings before you judge.",
            "",
            "it swings and does not calm down       make P larger, then I larger",
            "it overshoots, then calms down         make I larger, or D a little larger",
            "it is slow, without overshoot          make P smaller",
            "PV approaches SV slowly                make I smaller",
            "it stays below SV for good             I is 0, or the heater is too weak:",
            "                                       MV at 100 % means too weak",
            "output is noisy                        make D smaller, the filter larger",
            "it was good and is not any more        look at sensor, valves and load",
            "                                       first; then tune again",
            "after a door opens it swings           make D larger, P larger",
            "nothing fits                           auto-tuning (T), then fuzzy",
            "",
            "The trends tab (2) shows PV, SV and MV over each other: look there.",
        ],
    ),
    (
        "program, sets and memory",
        &[
            "program  g: SV follows steps by itself. A ramp brings it to the target of",
            "         the step in the ramp time, a soak stays there for the soak time.",
            "         Hold stops the clock where it is; off goes back to the fixed SV.",
            "         Time in a step is counted by this station, not by the controller.",
            "",
            "sets     s: all settings of a device under a name, as a file of the station",
            "         that can be read. Compare shows what differs from the device now;",
            "         restore writes only that, one value at a time, each read back, and",
            "         stops at the first that fails. Limits that must be wider for a new",
            "         value are written before it. Commands are never part of a set.",
            "copy     The other controllers of the same kind stand below the sets and can",
            "         be compared and copied in the same way.",
            "",
            "memory   A write changes the running value. f, FIX, keeps it over a power",
            "         cut, where the controller has it. Do not save often: the memory",
            "         wears out.",
        ],
    ),
];

/// Draws a page.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, page: usize) {
    let Some((heading, lines)) = PAGES.get(page) else { return };
    canvas.text(1, 0, heading, cx.theme.strong());
    let end = canvas.width().saturating_sub(1);
    canvas.text_right(end, 0, &format!("{}/{}", page + 1, PAGES.len()), cx.theme.dim());
    for (y, line) in lines.iter().enumerate() {
        canvas.text(2, to_u16(y) + 2, line, cx.theme.normal());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::widgets::text::width;

    #[test]
    fn every_page_can_be_read_whole_on_a_screen_of_80_by_24() {
        for (heading, lines) in PAGES {
            assert!(lines.len() <= 16, "{heading} has {} lines", lines.len());
            for line in *lines {
                assert!(width(line) <= 77, "{heading}: {} columns: {line}", width(line));
            }
        }
    }
}
