//! `[corrections]` of a `train.toml`: what measured runs have added to the declared model.

use dynocar_model::terms::CORRECTIONS;
use dynocar_model::train::TrainModel;

use super::document::Item;
use super::error::DatasetError;

/// Reads the table into a train; what is absent corrects nothing.
pub(super) fn read_corrections(section: &Item, train: &mut TrainModel) -> Result<(), DatasetError> {
    section.allow(&CORRECTIONS.map(|key| key.name))?;
    for key in CORRECTIONS {
        let value = section.checked_under(key.name, key.allowed, |value| key.allows(value))?;
        if let Some(value) = value {
            *(key.of)(train) = value;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::parse_train;
    use dynocar_model::train::Corrections;

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
