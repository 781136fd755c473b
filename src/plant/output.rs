//! What the output of a controller is at its terminals, and what a manipulated value in percent is there.

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;
use crate::t;

keyword_enum! {
    /// The kind of an output, as the order code of the controller says.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Output: "output" {
        /// A current: 0 % is 4 mA, 100 % is 20 mA.
        Current => "4-20 mA",
        /// A relay or a voltage for an SSR, on for a share of each cycle.
        Pulse => "pulse",
    }
}

impl Output {
    /// What this output in percent is at the terminals; `None` outside 0 to 100 %, where the manuals do not say.
    pub fn text(self, percent: f64) -> Option<String> {
        let percent = Some(percent).filter(|percent| (0.0..=100.0).contains(percent))?;
        Some(match self {
            Output::Current => format!("{:.2} mA", 4.0 + percent * 0.16),
            Output::Pulse => t!("on {percent} % of each cycle", percent = format!("{percent:.1}")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manipulated_value_is_shown_as_it_is_at_the_terminals() {
        let check = |output: Output, percent: f64, expect: Option<&str>| {
            assert_eq!(output.text(percent).as_deref(), expect, "{percent} %");
        };
        check(Output::Current, 0.0, Some("4.00 mA"));
        check(Output::Current, 52.01, Some("12.32 mA"));
        check(Output::Current, 100.0, Some("20.00 mA"));
        check(Output::Pulse, 52.01, Some("on 52.0 % of each cycle"));
        for output in Output::ALL {
            check(output, -3.0, None);
            check(output, 103.0, None);
            check(output, f64::NAN, None);
        }
    }
}
