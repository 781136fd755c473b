//! Times and factors of time as people write them.

/// A span as people write it: `10m`, `1h 30m`, `500ms`.
pub fn span(text: &str) -> Result<std::time::Duration, String> {
    let span: jiff::SignedDuration =
        text.parse().map_err(|_| format!("found `{text}`, expected a time like 10m or 8h"))?;
    std::time::Duration::try_from(span).map_err(|_| format!("found `{text}`, expected a time above zero"))
}

/// A factor of time, at least one.
pub fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (1.0..=1000.0).contains(&speed) => Ok(speed),
        Ok(_) | Err(_) => Err(format!("found `{text}`, expected a number from 1 to 1000")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_and_speeds_are_checked() {
        assert_eq!(span("10m"), Ok(std::time::Duration::from_secs(600)));
        assert!(span("ten").is_err_and(|error| error.contains("found `ten`, expected")));
        assert!(span("-5s").is_err());
        assert_eq!(speed("60"), Ok(60.0));
        assert!(speed("0").is_err());
    }
}
