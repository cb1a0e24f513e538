//! Why an effect is not accepted, in words.

use dynocar_shared::vocabulary::EffectKind;

use crate::explain::effects::AtBound;

/// Share of the error below which a weak effect is refused for removing too little, above for too little evidence.
const LITTLE: f64 = 0.2;

/// Why an effect is not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its evidence is negative.
    Chance,
    /// It is smaller than the usual errors of declared figures.
    Immaterial,
    /// A parameter lies at a bound of its range: these data do not determine it.
    AtBound(AtBound),
    /// The fitted values contradict the kind.
    Contradiction(&'static str),
    /// It changes the mass of single runs no more than loads usually do, which explains it.
    UsualLoads,
    /// This kind explains more jointly with the usual errors.
    GivesWay(EffectKind),
    /// It removes too little of the error for its evidence, this share of it.
    Weak(f64),
}

impl Refusal {
    /// Returns whether only the kind is in doubt: something is left to explain.
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
