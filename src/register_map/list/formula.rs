//! Formulas that only scale: `x / 10`, `x * 2 * 0.01`, `x * Math.pow(10, sf['40065'])` of ioBroker.

use super::words::power_of_ten;

/// What a number is multiplied by.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    /// A factor.
    pub factor: f64,
    /// The address of a power of ten, as written.
    pub power_at: Option<String>,
}

impl Formula {
    /// `None` for whatever does more.
    pub fn of(text: &str) -> Option<Formula> {
        let plain: String = text.chars().filter(|sign| !sign.is_whitespace()).collect();
        let mut rest = plain.strip_prefix('x')?;
        let mut formula = Formula { factor: 1.0, power_at: None };
        while !rest.is_empty() {
            let (sign, operand) = rest.split_at_checked(1)?;
            let end = if operand.starts_with("Math.pow(") { operand.find(')')? + 1 } else { 0 };
            let length = end + operand.get(end..)?.find(['*', '/']).unwrap_or(operand.len() - end);
            let (operand, behind) = operand.split_at_checked(length)?;
            rest = behind;
            let power = operand.strip_prefix("Math.pow(10,").and_then(|power| power.strip_suffix(')'));
            let place = power.and_then(|power| power.strip_prefix("sf['")?.strip_suffix("']"));
            match (sign, place, &formula.power_at) {
                ("*", Some(place), None) => formula.power_at = Some(place.to_owned()),
                ("*" | "/", None, _) => {
                    let number =
                        power.map_or_else(|| operand.parse().ok(), |power| power.parse().ok().map(power_of_ten));
                    let number = number.filter(|number: &f64| number.is_finite() && *number != 0.0)?;
                    // As a person would write it.
                    formula.factor =
                        if sign == "*" { rounded(formula.factor * number) } else { formula.factor / number };
                }
                _ => return None,
            }
        }
        Some(formula)
    }
}

/// 2 times 0.01 without what the product of two floats adds.
fn rounded(number: f64) -> f64 {
    format!("{number:.12e}").parse().unwrap_or(number)
}
