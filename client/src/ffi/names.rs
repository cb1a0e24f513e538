//! The vocabularies' names as C strings.

use std::ffi::{CStr, c_char};

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Manoeuvre, MassSource, Parameter, PipelineKind, Quantity, Reason, RejectionReason, Status,
};

/// Room for the longest name and its NUL.
const NAME_BYTES: usize = 40;
const UNKNOWN: &CStr = c"(a number of another release)";

/// A name followed by NULs.
const fn padded(name: &str) -> [u8; NAME_BYTES] {
    assert!(name.len() < NAME_BYTES);
    let mut bytes = [0; NAME_BYTES];
    let mut i = 0;
    while i < name.len() {
        bytes[i] = name.as_bytes()[i];
        i += 1;
    }
    bytes
}

/// Exports the names of one vocabulary.
macro_rules! export_names {
    ($( $(#[$meta:meta])* $function:ident: $vocabulary:ident by $number:expr ),* $(,)?) => { $(
        $(#[$meta])*
        /// Never NULL, never to be freed.
        ///
        /// # Real-time
        ///
        /// Safe for the control cycle.
        #[unsafe(no_mangle)]
        pub extern "C" fn $function(number: u32) -> *const c_char {
            const COUNT: usize = $vocabulary::ALL.len();
            static NAMES: [[u8; NAME_BYTES]; COUNT] = {
                let mut names = [[0; NAME_BYTES]; COUNT];
                let mut i = 0;
                while i < COUNT {
                    names[i] = padded($vocabulary::ALL[i].name());
                    i += 1;
                }
                names
            };
            let number_of: fn($vocabulary) -> u32 = $number;
            let index = $vocabulary::ALL.iter().position(|member| number_of(*member) == number);
            index.map_or(UNKNOWN.as_ptr(), |index| NAMES[index].as_ptr().cast())
        }
    )* };
}

export_names! {
    /// The name of a [`PipelineKind`].
    dynocar_pipeline_name: PipelineKind by |it| it as u32,
    /// The name of a [`Quantity`].
    dynocar_quantity_name: Quantity by |it| it as u32,
    /// The name of a [`MassSource`].
    dynocar_mass_source_name: MassSource by |it| it as u32,
    /// The name of a [`Parameter`].
    dynocar_parameter_name: Parameter by |it| it as u32,
    /// The name of a [`Status`].
    dynocar_status_name: Status by |it| it as u32,
    /// The name of a [`Reason`].
    dynocar_reason_name: Reason by |it| it as u32,
    /// The name of a [`RejectionReason`].
    dynocar_rejection_name: RejectionReason by |it| it as u32,
    /// The name of a [`Manoeuvre`], by its bit.
    dynocar_manoeuvre_name: Manoeuvre by Manoeuvre::bit,
    /// The name of an [`EffectKind`].
    dynocar_effect_name: EffectKind by |it| it as u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(name: *const c_char) -> &'static str {
        // SAFETY: the names are static and end with a NUL.
        unsafe { CStr::from_ptr(name) }.to_str().unwrap()
    }

    #[test]
    fn every_member_has_its_name_and_other_numbers_say_so() {
        for &kind in PipelineKind::ALL {
            assert_eq!(text(dynocar_pipeline_name(kind as u32)), kind.name());
        }
        for &effect in EffectKind::ALL {
            assert_eq!(text(dynocar_effect_name(effect as u32)), effect.name());
        }
        assert_eq!(text(dynocar_status_name(99)), "(a number of another release)");
    }
}
