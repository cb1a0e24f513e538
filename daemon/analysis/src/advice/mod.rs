//! Advice on the next manoeuvre: the one that most narrows the least known quantity.
//!
//! Everything comes from a snapshot and the declaration of the train: the present covariance, the noise behind it
//! ([`noise`]), the manoeuvres within the train's limits ([`manoeuvre`]), and the standard deviations that
//! `train_kalman` would have after each ([`rehearsal`]). Where driving does not help, the advice is a remedy in words
//! ([`remedy`]). The line is taken as level, since a snapshot does not state where the train is.

pub mod manoeuvre;
pub mod noise;
pub mod rehearsal;

use dynocar_core::remedy::of_reason;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{Manoeuvre, Parameter, ParameterSnapshot, Reason, Status};
use nalgebra::{Matrix3, Vector3};

use manoeuvre::{DriveKind, Scene};
use noise::{ANSWERED, RunNoise, davis_of};
use rehearsal::{Forecast, KnownBefore, MASS, forecast};

/// Durations in s of manoeuvres for a driver, the shortest first.
pub const WITHIN_S: [f64; 3] = [20.0, 60.0, 180.0];
/// The same for the mass: traction shows it soon or not at all.
const MASS_WITHIN_S: [f64; 2] = [20.0, 60.0];
/// Standard deviation, as a share of the mass, that is good enough: load weighing is no better.
const MASS_GOOD_SHARE: f64 = 0.005;
/// Share of the present interval that makes a manoeuvre worth asking for at once.
const GOOD_SHARE: f64 = 0.5;
/// Share of the present interval above which a manoeuvre is not worth the driving.
const WORTH_SHARE: f64 = 0.9;
/// Greatest interval after coasting, as a multiple of the best one, with which coasting is advised: it has no error of
/// a force.
const COASTING_SHARE: f64 = 1.05;

/// A manoeuvre with its effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// Parameter that the manoeuvre informs on.
    pub parameter: Parameter,
    /// The manoeuvre in words.
    pub drive: String,
    /// Standard deviation now, in the parameter's unit in a snapshot.
    pub std_now: f64,
    /// And after it.
    pub std_after: f64,
}

impl Advice {
    /// In words: "20 s coasting from 25 m/s (90 km/h) halves the interval of c".
    pub fn in_words(&self) -> String {
        let name = if self.parameter == Parameter::Mass { "mass" } else { self.parameter.name() };
        let interval = format!("the interval of {name}");
        let effect = match self.std_after / self.std_now {
            share if share < 0.3 => format!("divides {interval} by {:.0}", share.recip()),
            share if share < 0.4 => format!("cuts {interval} to a third"),
            share if share <= 0.55 => format!("halves {interval}"),
            share => format!("narrows {interval} by {:.0} %", 100.0 * (1.0 - share)),
        };
        format!("{} {effect}", self.drive)
    }
}

/// Returns the uncertainty after each manoeuvre of the catalogue, for a train whose mass in t has a standard
/// deviation, 0 where it is exact.
pub fn forecasts(
    snapshot: &ParameterSnapshot,
    train: &TrainModel,
    (mass_t, mass_std_t): (f64, f64),
    noise: &RunNoise,
    within_s: f64,
) -> Vec<Forecast> {
    let Some((davis, covariance)) = davis_of(snapshot) else { return Vec::new() };
    let scene = Scene::new(train, davis, 1e3 * mass_t, snapshot.speed_max_mps);
    let known = KnownBefore { davis: covariance, mass_std_t };
    let drives = scene.catalogue(within_s);
    drives.into_iter().filter_map(|drive| forecast(&scene, &known, noise, drive)).collect()
}

/// Returns the manoeuvre for the worst-known coefficient; `None` where none of three minutes is worth it.
///
/// Worst known is the coefficient whose standard deviation makes most of the resistance's at the train's
/// highest speed. The shortest time in which the best manoeuvre halves its interval is advised, else the
/// longest.
pub fn for_resistance(
    snapshot: &ParameterSnapshot,
    train: &TrainModel,
    mass: (f64, f64),
    noise: &RunNoise,
) -> Option<Advice> {
    let (davis, covariance) = davis_of(snapshot)?;
    let now = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let top_mps = Scene::new(train, davis, 1e3 * mass.0, snapshot.speed_max_mps).speed_max_mps;
    let worst = now.component_mul(&Vector3::new(1.0, top_mps, top_mps * top_mps)).imax();
    let share = |it: &Forecast| it.std[worst] / now[worst];
    let best_within = |within_s| best(&forecasts(snapshot, train, mass, noise, within_s), worst);
    let mut chosen = None;
    for within_s in WITHIN_S {
        chosen = best_within(within_s).or(chosen);
        if chosen.as_ref().is_some_and(|it| share(it) <= GOOD_SHARE) {
            break;
        }
    }
    let chosen = chosen.filter(|it| share(it) <= WORTH_SHARE)?;
    Some(advice(&chosen, worst, now[worst]))
}

/// Returns the manoeuvre that narrows the mass most, by a resistance and its covariance; `None` where the mass is
/// known well enough, or none helps.
pub fn for_mass(
    snapshot: &ParameterSnapshot,
    train: &TrainModel,
    (davis, covariance): (Davis, Matrix3<f64>),
    noise: &RunNoise,
) -> Option<Advice> {
    let (mass_t, std_t) = (snapshot.value(Parameter::Mass)?, snapshot.std(Parameter::Mass)?);
    if !(mass_t > 0.0 && std_t > MASS_GOOD_SHARE * mass_t) {
        return None;
    }
    let scene = Scene::new(train, davis, 1e3 * mass_t, snapshot.speed_max_mps);
    let known = KnownBefore { davis: covariance, mass_std_t: std_t };
    let within = |within_s: f64| {
        let drives = scene.catalogue(within_s).into_iter();
        drives
            .filter(|drive| matches!(drive.kind, DriveKind::Accelerate | DriveKind::Brake))
            .filter_map(|drive| forecast(&scene, &known, noise, drive))
            .min_by(|one, other| one.std[MASS].total_cmp(&other.std[MASS]))
    };
    let is_worth = |it: &Forecast| it.std[MASS] <= WORTH_SHARE * std_t;
    let chosen =
        MASS_WITHIN_S.into_iter().find_map(|within_s| within(within_s).filter(is_worth))?;
    Some(advice(&chosen, MASS, std_t))
}

fn advice(chosen: &Forecast, index: usize, std_now: f64) -> Advice {
    Advice {
        parameter: ANSWERED[index],
        drive: chosen.drive.in_words(chosen.lasts_s, chosen.end_mps),
        std_now,
        std_after: chosen.std[index],
    }
}

/// Returns the forecast that leaves the least of a coefficient's standard deviation; coasting where it is as good.
pub fn best(forecasts: &[Forecast], coefficient: usize) -> Option<Forecast> {
    let std = |it: &&Forecast| it.std[coefficient];
    let least = |all: &mut dyn Iterator<Item = &Forecast>| {
        all.min_by(|one, other| std(one).total_cmp(&std(other))).copied()
    };
    let overall = least(&mut forecasts.iter())?;
    let coasting = least(&mut forecasts.iter().filter(|it| it.drive.kind == DriveKind::Coast));
    let is_as_good = |it: &Forecast| std(&it) <= COASTING_SHARE * std(&&overall);
    Some(coasting.filter(is_as_good).unwrap_or(overall))
}

/// Returns the remedy of a reservation that no manoeuvre lifts; `None` where there is no reservation, or driving
/// helps.
pub const fn remedy(status: Status, reason: Option<Reason>) -> Option<&'static str> {
    match reason {
        None => Some("a newer daemon gives a reason that is unknown here"),
        Some(Reason::None | Reason::TooFewSamples | Reason::WeakExcitation) => None,
        Some(Reason::AtBound | Reason::NotIdentifiable) if matches!(status, Status::Estimated) => {
            None
        }
        Some(reason) => Some(of_reason(reason)),
    }
}

/// Returns the name of a manoeuvre that a pipeline lacks, where no numbers can be given yet.
pub const fn in_words(manoeuvre: Manoeuvre) -> &'static str {
    match manoeuvre {
        Manoeuvre::CoastSlow => "coasting at low speed",
        Manoeuvre::CoastFast => "coasting at high speed",
        Manoeuvre::VarySpeed => "driving at other speeds",
        Manoeuvre::Accelerate => "strong traction",
        Manoeuvre::Brake => "strong braking",
        Manoeuvre::Move => "driving",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reservation_that_driving_does_not_lift_has_a_remedy() {
        for &reason in Reason::ALL {
            let advice = remedy(Status::Degraded, Some(reason));
            let is_driven =
                matches!(reason, Reason::None | Reason::TooFewSamples | Reason::WeakExcitation);
            assert_eq!(advice.is_none(), is_driven, "{reason}");
            assert!(advice.is_none_or(|words| words.len() <= 72), "fits a line of 80: {reason}");
        }
        assert_eq!(remedy(Status::Estimated, Some(Reason::AtBound)), None);
    }
}
