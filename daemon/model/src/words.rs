//! Words of every answer: kinds of effects, their numbers and places, in the same words in statements, on terminals,
//! pages and timelines, in events, in the store of models, and for a fleet.

use dynocar_shared::vocabulary::{EffectKind, KindRow};

/// Places named in a sentence at most.
pub const PLACES_MAX: usize = 4;

/// Returns the name of a kind as the answer writes it, for a running text.
pub fn kind_name(name: &str) -> &str {
    match EffectKind::from_name(name) {
        Some(known) => KindRow::of(known).title,
        None => name,
    }
}

/// Returns the meaning of a parameter, without its symbol or name, and its unit.
pub fn parameter(name: &str) -> (&str, &'static str) {
    let (meaning, unit, _) = row(name);
    (meaning, unit)
}

/// Returns the least value of a parameter, below which no interval reaches.
pub fn least(name: &str) -> f64 {
    row(name).2
}

/// Returns the meaning of a parameter, its unit and its least value.
fn row(name: &str) -> (&str, &'static str, f64) {
    const ANY: f64 = f64::NEG_INFINITY;
    match name {
        "c_factor" => ("factor on c v²", "", 0.0),
        "dc_n_per_mps2" => ("extra drag with the whole train inside", "N/(m/s)²", ANY),
        "k_n_per_kn_m" => ("curve constant k in k/R", "N/kN · m", 0.0),
        "wind_plus_mps" => ("headwind for travel towards growing chainage", "m/s", ANY),
        "headwind_mps" => ("headwind", "m/s", ANY),
        "force_n" => ("drag force", "N", 0.0),
        "speed_scale" => ("measured over true speed", "", ANY),
        "rms_permille" => ("root mean square of the gradient's error", "‰", ANY),
        "profile" => ("error of the gradient", "‰", ANY),
        "shift_m" => ("shift towards growing chainage", "m", ANY),
        "mass_factor" => ("true over declared mass", "", 0.0),
        "gain" => ("reported over true force", "", ANY),
        "delay_and_lag_s" => ("dead time and lag together", "s", 0.0),
        "delay_s" => ("dead time", "s", 0.0),
        "lag_s" => ("lag", "s", 0.0),
        "rotating_mass_factor" => ("rotating-mass factor", "", 0.0),
        "delta_a_n_per_kn" => ("extra resistance at the start", "N/kN", 0.0),
        "tau_s" => ("time constant", "s", 0.0),
        "w0_per_k" => ("relative change of resistance", "1/K", ANY),
        "reference_k" => ("reference temperature", "K", ANY),
        "extra_n_per_kn" => ("extra resistance", "N/kN", ANY),
        "gradient_error_permille" => ("error of the gradient", "‰", ANY),
        "force_error_share" => ("share of the force that is missing", "", ANY),
        "at" | "second_at" => ("where it is greatest, or its reference", "", ANY),
        "exponent" | "second_exponent" => ("exponent", "", ANY),
        "below" | "second_below" => ("acts below", "", ANY),
        "least" | "second_least" => ("grows no more below", "", ANY),
        "from" | "second_from" => ("acts from", "", ANY),
        "until" | "second_until" => ("acts until", "", ANY),
        "over" | "second_over" => ("fades over", "", ANY),
        "width" | "second_width" => ("width", "", ANY),
        "adhesion" => ("adhesion", "", 0.0),
        "achieved_ratio" => ("achieved over reported brake force", "", 0.0),
        other => (other, "", ANY),
    }
}

/// Returns a value with the digits that its uncertainty leaves meaningful: two of the uncertainty's.
pub fn number(value: f64, uncertainty: Option<f64>) -> String {
    let scale = uncertainty.filter(|it| it.is_finite() && *it > 0.0);
    let leading = scale.unwrap_or(value.abs().max(1e-9) * 0.01).log10().floor();
    let decimals = (1.0 - leading).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        return if scale.is_some() { text.trim_start_matches('-').into() } else { "0".into() };
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

/// Returns the words joined by commas and a last "and".
pub fn joined(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Returns a number of an effect with its meaning, unit and 95 % interval of a half width; `None` for a convention,
/// which has no interval. Behind its name and a space may stand the run that it is of.
pub fn figure(name: &str, value: f64, half: f64) -> Option<String> {
    let (name, run) = name.split_once(' ').unwrap_or((name, ""));
    let (words, unit) = parameter(name);
    let run = if run.is_empty() { String::new() } else { format!(" in {run}") };
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    (half > 0.0).then(|| match name {
        "speed_scale" => speed_error(value, half),
        _ => {
            let ends = [(value - half).max(least(name)), value + half];
            let [low, high] = ends.map(|it| number(it, Some(half)));
            let value = number(value, Some(half));
            format!("{words}{run} {value}{unit} (95 % interval {low} to {high})")
        }
    })
}

/// Returns the words for a wrong wheel diameter: the error of the measured speed, with its 95 % interval.
fn speed_error(scale: f64, half: f64) -> String {
    let side = if scale > 1.0 { "high" } else { "low" };
    let percent =
        |scale: f64| number(100.0 * (scale - 1.0) * (scale - 1.0).signum(), Some(100.0 * half));
    let mut ends =
        [scale - half, scale + half].map(|it| 100.0 * (it - 1.0) * (scale - 1.0).signum());
    ends.sort_unstable_by(f64::total_cmp);
    let [low, high] = ends.map(|it| number(it, Some(100.0 * half)));
    format!("speeds read {} % too {side} (95 % interval {low} to {high})", percent(scale))
}

/// A stretch of the line from one chainage in m to another.
pub fn stretch([from_m, to_m]: [f64; 2]) -> String {
    format!("from km {:.2} to {:.2}", from_m / 1000.0, to_m / 1000.0)
}

/// Stretches of the line, in m; many are counted, not listed.
pub fn stretches(intervals_m: &[[f64; 2]]) -> String {
    if intervals_m.len() <= PLACES_MAX {
        return joined(&intervals_m.iter().copied().map(stretch).collect::<Vec<_>>());
    }
    let ends_m = intervals_m.as_flattened().iter().copied();
    let [low, high] =
        [ends_m.clone().fold(f64::INFINITY, f64::min), ends_m.fold(f64::NEG_INFINITY, f64::max)];
    let [low, high] = [low, high].map(|end_m| format!("{:.2}", end_m / 1000.0));
    format!("at {} places between km {low} and {high}", intervals_m.len())
}

/// An effect by its kind and the stretches where it acts.
pub fn effect(kind: &str, intervals_m: &[[f64; 2]]) -> String {
    let words = [kind_name(kind), &stretches(intervals_m)].join(" ");
    words.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_show_two_digits_of_their_uncertainty() {
        assert_eq!([number(0.0, None), number(0.0, Some(0.02))], ["0", "0.000"]);
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

    #[test]
    fn stretches_are_listed_in_km_and_many_are_counted() {
        let tunnels = [[5200.0, 6900.0], [8000.0, 8100.0]];
        assert_eq!(stretches(&tunnels), "from km 5.20 to 6.90 and from km 8.00 to 8.10");
        assert_eq!(effect("tunnel_drag", &tunnels[..1]), "tunnel drag from km 5.20 to 6.90");
        assert_eq!(effect("tunnel_drag", &[]), "tunnel drag");
        let curves: Vec<[f64; 2]> =
            (0..9).map(|k| [1e3 * f64::from(k), 1e3 * f64::from(k) + 300.0]).collect();
        assert_eq!(stretches(&curves), "at 9 places between km 0.00 and 8.30");
    }
}
