//! Names and units for people.

use dynocar_shared::vocabulary::{EffectKind, KindRow};

/// Name of a kind as the answer writes it, for a running text.
pub fn kind_name(name: &str) -> &str {
    match EffectKind::from_name(name) {
        Some(known) => KindRow::of(known).title,
        None => name,
    }
}

/// Returns the meaning of a parameter, without its symbol or name, and its unit.
pub fn parameter(name: &str) -> (&str, &'static str) {
    match name {
        "c_factor" => ("factor on c v²", ""),
        "dc_n_per_mps2" => ("extra drag with the whole train inside", "N/(m/s)²"),
        "k_n_per_kn_m" => ("curve constant k in k/R", "N/kN · m"),
        "wind_plus_mps" => ("headwind for travel towards growing chainage", "m/s"),
        "headwind_mps" => ("headwind", "m/s"),
        "force_n" => ("drag force", "N"),
        "speed_scale" => ("measured over true speed", ""),
        "rms_permille" => ("root mean square of the gradient's error", "‰"),
        "profile" => ("error of the gradient", "‰"),
        "shift_m" => ("shift towards growing chainage", "m"),
        "mass_factor" => ("true over declared mass", ""),
        "gain" => ("reported over true force", ""),
        "delay_and_lag_s" => ("dead time and lag together", "s"),
        "delay_s" => ("dead time", "s"),
        "lag_s" => ("lag", "s"),
        "rotating_mass_factor" => ("rotating-mass factor", ""),
        "delta_a_n_per_kn" => ("extra resistance at the start", "N/kN"),
        "tau_s" => ("time constant", "s"),
        "w0_per_k" => ("relative change of resistance", "1/K"),
        "reference_k" => ("reference temperature", "K"),
        "extra_n_per_kn" => ("extra resistance", "N/kN"),
        "gradient_error_permille" => ("error of the gradient", "‰"),
        "force_error_share" => ("share of the force that is missing", ""),
        "at" | "second_at" => ("where it is greatest, or its reference", ""),
        "exponent" | "second_exponent" => ("exponent", ""),
        "below" | "second_below" => ("acts below", ""),
        "least" | "second_least" => ("grows no more below", ""),
        "from" | "second_from" => ("acts from", ""),
        "until" | "second_until" => ("acts until", ""),
        "over" | "second_over" => ("fades over", ""),
        "width" | "second_width" => ("width", ""),
        "adhesion" => ("adhesion", ""),
        "achieved_ratio" => ("achieved over reported brake force", ""),
        other => (other, ""),
    }
}

/// The least that a parameter can be: what no interval reaches below.
pub fn least(name: &str) -> f64 {
    match name {
        "c_factor"
        | "k_n_per_kn_m"
        | "force_n"
        | "mass_factor"
        | "delay_and_lag_s"
        | "delay_s"
        | "lag_s"
        | "rotating_mass_factor"
        | "delta_a_n_per_kn"
        | "tau_s"
        | "adhesion"
        | "achieved_ratio" => 0.0,
        _ => f64::NEG_INFINITY,
    }
}

/// A value with the digits that its uncertainty leaves meaningful: two of the uncertainty's.
pub fn number(value: f64, uncertainty: Option<f64>) -> String {
    let scale = uncertainty.filter(|it| it.is_finite() && *it > 0.0);
    let leading = scale.unwrap_or(value.abs().max(1e-9) * 0.01).log10().floor();
    let decimals = (1.0 - leading).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        return text.trim_start_matches('-').into();
    }
    text.replacen('-', "−", 1)
}

/// A share in percent without its sign, with a decimal where its interval is narrow.
pub fn percent(share: f64, interval: Option<[f64; 2]>) -> String {
    let is_narrow = interval.is_some_and(|[low, high]| high > low && high - low < 0.02);
    let text = format!("{:.*}", usize::from(is_narrow), 100.0 * share);
    let digits = text.trim_start_matches('-');
    let is_zero = digits.chars().all(|c| c == '0' || c == '.');
    if is_zero { digits.into() } else { text.replacen('-', "−", 1) }
}

/// Words joined by commas and a last "and".
pub fn joined(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_show_two_digits_of_their_uncertainty() {
        assert_eq!(number(3058.57, Some(210.7)), "3059");
        assert_eq!(number(5.32302, Some(0.19)), "5.32");
        assert_eq!(number(-0.005154, Some(0.00038)), "−0.00515");
        assert_eq!(number(-0.0001, Some(0.2)), "0.00");
        assert_eq!(number(0.5846, None), "0.5846");
    }

    #[test]
    fn shares_show_a_decimal_where_their_interval_is_narrow() {
        assert_eq!(percent(0.6012, Some([0.596, 0.604])), "60.1");
        assert_eq!(percent(0.6012, Some([0.5, 0.7])), "60");
        assert_eq!(percent(-0.2, None), "−20");
        assert_eq!(percent(-0.0001, Some([0.0, 0.0])), "0");
    }

    #[test]
    fn lists_read_as_sentences() {
        let words = |list: &[&str]| joined(&list.iter().map(|&w| w.into()).collect::<Vec<_>>());
        assert_eq!(words(&["a"]), "a");
        assert_eq!(words(&["a", "b", "c"]), "a, b and c");
    }
}
