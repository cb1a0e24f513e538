//! Covariates against which the residual is plotted.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::vocabulary::{EffectKind, KindRow};

use super::windows::FitWindow;
use crate::explain::evidence::RunData;

/// Covariate on which a residual may depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covariate {
    /// Chainage of the train's centre.
    Chainage,
    /// Speed.
    Speed,
    /// Time since the run's start.
    TimeSinceStart,
    /// The fit run, numbered from 1.
    Run,
    /// Direction of travel.
    Direction,
    /// Gradient along the travel.
    Gradient,
    /// Mean curvature along the train.
    Curvature,
    /// Share of the train inside tunnels.
    TunnelShare,
    /// Traction minus brake.
    ControlForce,
    /// Change of the control force with time.
    ForceChange,
    /// Measured acceleration.
    Acceleration,
    /// Outside temperature.
    Temperature,
    /// Brake-cylinder pressure.
    CylinderPressure,
    /// Time within one fit run, by its place among the fit runs.
    TimeInRun(usize),
}

/// A covariate for people.
pub struct CovariateRow {
    /// Which.
    pub covariate: Covariate,
    title: &'static str,
    unit: &'static str,
    per_unit: f64,
}

const fn row(
    covariate: Covariate,
    title: &'static str,
    unit: &'static str,
    per_unit: f64,
) -> CovariateRow {
    CovariateRow { covariate, title, unit, per_unit }
}

/// Those that every window of every run may have, in the order of the page.
pub const COMMON: [CovariateRow; 13] = [
    row(Covariate::Chainage, "Chainage", "km", 1000.0),
    row(Covariate::Speed, "Speed", "m/s", 1.0),
    row(Covariate::TimeSinceStart, "Time since start", "s", 1.0),
    row(Covariate::Run, "Run", "", 1.0),
    row(Covariate::Direction, "Direction of travel", "", 1.0),
    row(Covariate::Gradient, "Gradient along the travel", "‰", 1.0),
    row(Covariate::Curvature, "Curvature", "1/km", 0.001),
    row(Covariate::TunnelShare, "Share of the train in tunnels", "", 1.0),
    row(Covariate::ControlForce, "Traction minus brake force", "kN", 1000.0),
    row(Covariate::ForceChange, "Change of force", "kN/s", 1000.0),
    row(Covariate::Acceleration, "Acceleration", "m/s²", 1.0),
    row(Covariate::Temperature, "Outside temperature", "°C", 1.0),
    row(Covariate::CylinderPressure, "Brake-cylinder pressure", "kPa", 1000.0),
];
/// Of one run only.
const TIME_IN_RUN: CovariateRow = row(Covariate::TimeInRun(0), "Time in the run", "s", 1.0);

impl Covariate {
    /// Always shown when the data have them.
    pub const ALWAYS: [Covariate; 4] =
        [Covariate::Chainage, Covariate::Speed, Covariate::TimeSinceStart, Covariate::Run];

    /// Returns the one over which a kind is seen best.
    pub fn of_kind(kind: EffectKind) -> Option<Self> {
        KindRow::of(kind).seen_over.and_then(Covariate::of_name)
    }

    /// Returns the one that a place or a kind's row names.
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "chainage_m" => Covariate::Chainage,
            "speed_mps" => Covariate::Speed,
            "time_since_start_s" => Covariate::TimeSinceStart,
            "traction_force_n" | "brake_force_n" => Covariate::ControlForce,
            "ambient_temperature_degc" => Covariate::Temperature,
            "run" => Covariate::Run,
            "direction" => Covariate::Direction,
            "curvature_per_m" => Covariate::Curvature,
            "force_change_n_per_s" => Covariate::ForceChange,
            "acceleration_mps2" => Covariate::Acceleration,
            _ => return None,
        })
    }

    fn row(self) -> &'static CovariateRow {
        let own = |row: &&CovariateRow| row.covariate == self;
        COMMON.iter().find(own).unwrap_or(&TIME_IN_RUN)
    }

    /// Returns the name for people.
    pub fn title(self) -> &'static str {
        self.row().title
    }

    /// Returns the unit of its values; empty for numbers and names.
    pub fn unit(self) -> &'static str {
        self.row().unit
    }

    /// SI value over the value in [`Covariate::unit`].
    pub fn per_unit(self) -> f64 {
        self.row().per_unit
    }

    /// Returns whether its values are names, not quantities.
    pub fn is_category(self) -> bool {
        matches!(self, Covariate::Run | Covariate::Direction)
    }

    /// Returns its mean over a window, in SI units (temperature in °C); `None` where it is not known or
    /// does not apply.
    pub fn value(self, window: &FitWindow, run: &RunData) -> Option<f64> {
        let (bins, samples) = (window.bins(run), run.samples());
        let (first, last) = (bins.first()?, bins.last()?);
        let span_s = last.time_s - first.time_s;
        let mean = |value: &dyn Fn(&ResolvedSample) -> Option<f64>| -> Option<f64> {
            let sum: Option<f64> = bins.iter().map(|bin| value(&samples[bin.middle()])).sum();
            sum.map(|sum| sum / bins.len() as f64)
        };
        match self {
            Covariate::Chainage => mean(&|sample| sample.position_m),
            Covariate::Speed => mean(&|sample| Some(sample.speed_mps)),
            Covariate::TimeSinceStart => Some(0.5 * (first.time_s + last.time_s)),
            Covariate::Run => Some(window.run as f64 + 1.0),
            Covariate::Direction => Some(run.direction),
            Covariate::Gradient => mean(&|sample| sample.gradient_permille),
            Covariate::Curvature => mean(&|sample| sample.curvature_per_m),
            Covariate::TunnelShare => mean(&|sample| sample.tunnel_share),
            Covariate::ControlForce => mean(&ResolvedSample::control_force_n),
            Covariate::ForceChange => {
                let force =
                    |bin: &crate::explain::evidence::Bin| samples[bin.middle()].control_force_n();
                Some((force(last)? - force(first)?) / span_s)
            }
            Covariate::Acceleration => Some((last.speed_mps - first.speed_mps) / span_s),
            Covariate::Temperature => mean(&|sample| sample.ambient_temperature_degc),
            Covariate::CylinderPressure => mean(&|sample| sample.brake_cylinder_pressure_pa),
            Covariate::TimeInRun(index) if index == window.run => {
                Some(run.offset_s + 0.5 * (first.time_s + last.time_s))
            }
            Covariate::TimeInRun(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use dynocar_shared::vocabulary::KINDS;

    use super::*;

    #[test]
    fn what_a_kind_is_seen_over_is_a_covariate() {
        for row in &KINDS {
            assert_eq!(Covariate::of_kind(row.kind).is_some(), row.seen_over.is_some(), "{row:?}");
        }
    }
}
