//! Numbers as people write them.

/// 1, 2 or 5 times a power of ten, not above `most`: the length of a scale's bar, or a tick's step.
#[must_use]
pub fn round_length(most: f64) -> f64 {
    if !(most > 0.0 && most.is_finite()) {
        return 1.0;
    }
    let decade = 10_f64.powf(most.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|step| *step <= most)
        .unwrap_or(decade)
}

/// A number with at most four significant digits.
#[must_use]
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.3e}");
    text.parse::<f64>().map_or(text, |rounded| rounded.to_string())
}

/// Six significant digits, without zeros at the end.
#[must_use]
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = value.abs().log10().floor();
    if !(-5.0..7.0).contains(&size) {
        return format!("{value:.4e}");
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10")]
    let decimals = (5.0 - size).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_scales_are_round() {
        assert_eq!(round_length(140.0), 100.0);
        assert_eq!(round_length(0.0049), 0.002);
        assert_eq!(round_length(5.0), 5.0);
        assert_eq!(round_length(0.0), 1.0);
        assert_eq!(short(0.123_456), "0.1235");
        assert_eq!(short(-20.0), "-20");
        // Twice half of 6.942.
        assert_eq!(significant(6.941_999_999_999_999), "6.942");
        assert_eq!(significant(-1500.0), "-1500");
    }
}
