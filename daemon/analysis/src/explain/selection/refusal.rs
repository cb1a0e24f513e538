//! Why an effect is not accepted, in words.

use dynocar_shared::vocabulary::EffectKind;

use crate::explain::effects::AtBound;

/// A smaller share of the error is what an effect is refused for, a larger one its evidence.
const LITTLE: f64 = 0.2;

/// Why an effect is not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its evidence is negative.
    Chance,
    /// It is smaller than what declared figures are good for.
    Immaterial,
    /// A parameter lies at the bound of what is looked for: these data do not hold it.
    AtBound(AtBound),
    /// The fitted values contradict the kind.
    Contradiction(&'static str),
    /// It changes the mass of single runs no more than loads usually do, which explains it.
    UsualLoads,
    /// This kind explains more together with the usual errors.
    GivesWay(EffectKind),
    /// For its evidence it takes too little from the error, this share of it.
    Weak(f64),
}

impl Refusal {
    /// Whether all but its name speaks for the effect: something is left to explain.
    pub fn leaves_a_residual(&self) -> bool {
        matches!(self, Refusal::AtBound(_) | Refusal::Contradiction(_))
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Refusal::Chance => "explains no more than chance",
            Refusal::Immaterial => "below the accuracy of declared figures",
            Refusal::AtBound(AtBound { name, bound }) => {
                return write!(
                    f,
                    "not identifiable from these data: {name} runs to the bound {bound} of what is \
                     looked for"
                );
            }
            Refusal::Contradiction(why) => why,
            Refusal::UsualLoads => {
                "its runs stand out from the others no more than the largest of as many loads do"
            }
            Refusal::GivesWay(kind) => {
                return write!(f, "{} and the usual errors explain more", kind.name());
            }
            Refusal::Weak(share) if *share < 0.005 => "takes nothing from the error",
            Refusal::Weak(share) => {
                let why = if *share < LITTLE { ": too little" } else { ", on too little evidence" };
                return write!(f, "takes {:.0} % from the error{why}", 100.0 * share);
            }
        })
    }
}
