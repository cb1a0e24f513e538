//! Declared resistances that no train has, and the unit that they may be in.

use dynocar_model::train::Davis;

/// Basic resistances in N/kN that trains have at rest, and at their greatest speed; a declared 0 does not count.
const USUAL_AT_REST_N_PER_KN: (f64, f64) = (0.2, 15.0);
const USUAL_AT_TOP_N_PER_KN: (f64, f64) = (0.5, 60.0);

/// Describes an unusual resistance in N/kN up to a greatest speed in m/s, with the likely unit; `None` for one that
/// trains have.
pub fn unusual_resistance(davis: &Davis, top_mps: f64) -> Option<String> {
    let is_outside =
        |value: f64, (low, high): (f64, f64)| value != 0.0 && !(low..=high).contains(&value);
    let times = |what: &str, value: f64, usual: (f64, f64), units: &[(f64, &str)]| {
        let fits = |(factor, _): &&(f64, &str)| (usual.0..=usual.1).contains(&(factor * value));
        let likely = units.iter().find(fits).map_or(String::new(), |(factor, unit)| {
            format!(": {unit}? Then it is {:.2} N/kN", factor * value)
        });
        format!("{value:.2e} N/kN {what}, where trains have {} to {}{likely}", usual.0, usual.1)
    };
    if is_outside(davis.a, USUAL_AT_REST_N_PER_KN) {
        let units = [
            (1e3, "is a in kN where b and c are in N"),
            (1e-3, "is a in N for each t of weight"),
            (1.0 / 9.80665, "is a in N for each kN and a mass in t"),
        ];
        return Some(times("at rest", davis.a, USUAL_AT_REST_N_PER_KN, &units));
    }
    let top = davis.w0_n_per_kn(top_mps);
    let by_kmh = Davis { b: davis.b / 3.6, c: davis.c / 12.96, ..*davis }.w0_n_per_kn(top_mps);
    let units = [
        (by_kmh / top, "are b and c for v in km/h"),
        (1e3, "are b and c in kN where a is in N"),
        (1e-3, "are b and c for the whole train"),
    ];
    let what = format!("at {top_mps:.0} m/s");
    is_outside(top, USUAL_AT_TOP_N_PER_KN).then(|| times(&what, top, USUAL_AT_TOP_N_PER_KN, &units))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unusual_resistance_is_named_with_the_likely_unit() {
        let words = |a, b, c| unusual_resistance(&Davis { a, b, c }, 30.0);
        assert_eq!(words(1.5, 0.015, 0.0009), None);
        assert_eq!(words(0.0, 0.0, 0.0), None, "none is declared");
        assert_eq!(words(0.0, 0.02, 0.0009), None);
        let in_kn = words(0.00122, 0.015, 0.0009).unwrap();
        assert!(in_kn.contains("a in kN") && in_kn.contains("1.22 N/kN"), "{in_kn}");
        let by_kmh = words(1.5, 0.2, 0.09).unwrap();
        assert!(by_kmh.contains("at 30 m/s") && by_kmh.contains("km/h"), "{by_kmh}");
        let each_t = words(1500.0, 0.015, 0.0009).unwrap();
        assert!(each_t.contains("each t"), "{each_t}");
    }
}
