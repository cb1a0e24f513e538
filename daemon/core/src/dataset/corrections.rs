//! `[corrections]` of a `train.toml`: what measured runs have added to the declared model.

use super::document::Section;
use super::error::DatasetError;
use crate::train::Corrections;

/// A key, what is allowed, and where its value goes.
type Key = (&'static str, &'static str, [f64; 2], fn(&mut Corrections) -> &mut f64);

const KEYS: [Key; 10] = [
    ("speed_scale", "from 0.8 to 1.25", [0.8, 1.25], |it| &mut it.speed_scale),
    ("traction_gain", "from 0.5 to 2", [0.5, 2.0], |it| &mut it.traction_gain),
    ("actuator_delay_s", "from 0 to 6 s", [0.0, 6.0], |it| &mut it.actuator_delay_s),
    ("actuator_lag_s", "from 0 to 10 s", [0.0, 10.0], |it| &mut it.actuator_lag_s),
    ("tunnel_c_factor", "from 0 to 100", [0.0, 100.0], |it| &mut it.tunnel_c_factor),
    ("wind_plus_mps", "from -50 to 50 m/s", [-50.0, 50.0], |it| &mut it.wind_plus_mps),
    ("bearing_delta_a_n_per_kn", "from 0 to 50 N/kN", [0.0, 50.0], |it| {
        &mut it.bearing_delta_a_n_per_kn
    }),
    ("bearing_tau_s", "from 1 to 100000 s", [1.0, 1e5], |it| &mut it.bearing_tau_s),
    ("ambient_w0_per_k", "from -0.1 to 0.1 per kelvin", [-0.1, 0.1], |it| &mut it.ambient_w0_per_k),
    ("ambient_reference_k", "from 200 to 350 K", [200.0, 350.0], |it| &mut it.ambient_reference_k),
];

/// Reads the table; what is absent corrects nothing.
pub(super) fn corrections(section: &Section) -> Result<Corrections, DatasetError> {
    section.allow(&KEYS.map(|key| key.0))?;
    let mut corrections = Corrections::NONE;
    for (key, allowed, [low, high], field) in KEYS {
        if let Some(value) = section.number(key, allowed, |value| (low..=high).contains(&value))? {
            *field(&mut corrections) = value;
        }
    }
    Ok(corrections)
}

#[cfg(test)]
mod tests {
    use crate::dataset::parse_train;
    use crate::train::Corrections;

    const TRAIN: &str = "[train]\nmass_t = 10\nlength_m = 1\nrotating_mass_factor = 0\n\
                         [resistance]\na = 1\nb = 0\nc = 0\n";

    #[test]
    fn corrections_are_read_and_the_rest_corrects_nothing() {
        let text = format!("{TRAIN}[corrections]\ntunnel_c_factor = 1.9\nspeed_scale = 0.98\n");
        let known = parse_train("train.toml", &text).unwrap().corrections;
        let expected = Corrections { tunnel_c_factor: 1.9, speed_scale: 0.98, ..Corrections::NONE };
        assert_eq!(known, expected);
        assert_eq!(parse_train("train.toml", TRAIN).unwrap().corrections, Corrections::NONE);
    }

    #[test]
    fn a_wrong_correction_is_refused_with_what_was_allowed() {
        let text = format!("{TRAIN}[corrections]\nspeed_scale = 98\n");
        assert_eq!(
            parse_train("train.toml", &text).unwrap_err().to_string(),
            "train.toml:10: corrections.speed_scale = 98: expected from 0.8 to 1.25"
        );
    }
}
