//! The two models of the library.

use crate::estimators::{self, ESTIMATORS};
use crate::plant::{self, PLANT};
use crate::variables::Interface;

/// Both models.
pub const INTERFACES: [&Interface; 2] = [&ESTIMATORS, &PLANT];

/// Their GUIDs as a symbol, so that a library shows its own without being loaded.
#[unsafe(no_mangle)]
pub static DYNOCAR_FMU_GUIDS: [[u8; 16]; 2] = [estimators::GUID_DIGITS, plant::GUID_DIGITS];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units;

    #[test]
    fn names_are_unique_and_units_known() {
        for Interface { variables, .. } in INTERFACES {
            for (reference, variable) in variables.iter().enumerate() {
                assert!(variables[..reference].iter().all(|it| it.name != variable.name));
                assert!(variable.unit == units::NONE || units::ALL.contains(&variable.unit));
            }
        }
    }

    #[test]
    fn no_model_is_taken_for_the_other() {
        assert_ne!(ESTIMATORS.guid, PLANT.guid);
        assert_ne!(ESTIMATORS.identifier, PLANT.identifier);
    }
}
