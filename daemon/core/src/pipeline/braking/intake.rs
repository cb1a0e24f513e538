//! Observations and steps of a braking from the train's samples, and brake force from cylinder pressure.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::{Reason, RejectionReason};

use super::engine::{BrakingObservation, BrakingSettings};
use super::motion::StepInputs;

/// The coefficient to be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrakingCoefficient {
    /// Adhesion: brake force over weight.
    Adhesion,
    /// Disc friction, with the braking ratio held as declared.
    Friction,
    /// Braking ratio, with the friction held as declared.
    Ratio,
}

/// Traction per weight below which nothing pulls: a lagging actuator never releases completely.
const PULLING_MIN_PER_WEIGHT: f64 = 1e-4;

/// Share of its demand from which a brake has built up.
const BUILT_SHARE: f64 = 0.95;

/// Outcome of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intake {
    /// The train does not brake.
    NotBraking,
    /// The sample is part of the step that is being collected.
    Collected,
    /// The sample, or the train's description, lacks something.
    Missing(Reason),
    /// The sample cannot be used.
    Refused(RejectionReason),
    /// A braking starts here.
    Start(BrakingObservation),
    /// A step ends here.
    Step(StepInputs, BrakingObservation),
}

/// Modelled values at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    gain_mps2: f64,
    demand: f64,
    tied_mps2: f64,
    basic_mps2: [f64; 3],
}

/// Sums over the samples of a step, by the trapezoidal rule.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Collected {
    last: Known,
    step_s: f64,
    /// Time in s since the last sample that was added.
    skipped_s: f64,
    gain: f64,
    demand: f64,
    tied: f64,
}

impl Collected {
    fn from(first: Known) -> Self {
        Collected { last: first, step_s: 0.0, skipped_s: 0.0, gain: 0.0, demand: 0.0, tied: 0.0 }
    }

    fn add(&mut self, known: Known, step_s: f64) {
        let step_s = self.skipped_s + step_s;
        self.skipped_s = 0.0;
        let mean = |from: f64, to: f64| 0.5 * (from + to) * step_s;
        self.gain += mean(self.last.gain_mps2, known.gain_mps2);
        self.demand += mean(self.last.demand, known.demand);
        self.tied += mean(self.last.tied_mps2, known.tied_mps2);
        self.step_s += step_s;
        self.last = known;
    }

    fn inputs(&self) -> StepInputs {
        StepInputs {
            step_s: self.step_s,
            gain_mps2: self.gain / self.step_s,
            demand: self.demand / self.step_s,
            tied_mps2: self.tied / self.step_s,
            basic_mps2: self.last.basic_mps2,
        }
    }
}

/// Picks observations and collects the known motion between them.
#[derive(Clone, Debug)]
pub struct BrakingIntake {
    quantity: BrakingCoefficient,
    settings: BrakingSettings,
    gear: Option<DeclaredGear>,
    resistance: Davis,
    /// Full mass in kg where it is declared.
    full_kg: Option<f64>,
    braking: Option<Braking>,
}

#[derive(Clone, Copy, Debug)]
struct Braking {
    segment: u32,
    origin_m: f64,
    collected: Collected,
    build_up: BuildUp,
}

/// Coefficient that a brake as slow as may be lacked of its demand since a braking began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct BuildUp {
    /// As it has built up.
    built: f64,
    /// Sum over time in s of the part that lacks.
    lacking_s: f64,
    braked_s: f64,
    /// Time in s since it has nearly built up.
    built_s: f64,
}

impl BuildUp {
    fn add(&mut self, demand: f64, step_s: f64, lag_s: f64) {
        let left = if lag_s > 0.0 { (-step_s / lag_s).exp() } else { 0.0 };
        self.built = demand + left * (self.built - demand);
        self.lacking_s += step_s * (demand - self.built).max(0.0);
        self.braked_s += step_s;
        let is_building = self.built < BUILT_SHARE * demand;
        self.built_s = if is_building { 0.0 } else { self.built_s + step_s };
    }
}

impl BrakingIntake {
    /// Returns an intake for a train as declared.
    pub fn new(
        quantity: BrakingCoefficient,
        settings: BrakingSettings,
        train: &TrainModel,
    ) -> Self {
        let gear = DeclaredGear::from_gear(&train.brake_gear);
        let (resistance, full_kg) = (train.resistance, train.full_mass_kg);
        BrakingIntake { quantity, settings, gear, resistance, full_kg, braking: None }
    }

    /// Takes the next sample.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    pub fn take(&mut self, sample: &ResolvedSample) -> Intake {
        let gap_max_s = self.settings.gap_max_s;
        self.braking = self.braking.filter(|braking| {
            let Collected { step_s, skipped_s, .. } = braking.collected;
            let collected_s = step_s + skipped_s + sample.step_s;
            braking.segment == sample.segment && collected_s <= gap_max_s
        });
        let known = match self.known(sample) {
            Ok(Some(known)) if sample.speed_mps >= self.settings.speed_min_mps => known,
            Ok(_) => {
                self.braking = None;
                return Intake::NotBraking;
            }
            Err(reason) => {
                if let Some(braking) = &mut self.braking {
                    braking.collected.skipped_s += sample.step_s;
                }
                return Intake::Missing(reason);
            }
        };
        if let Some(braking) = &mut self.braking {
            braking.collected.add(known, sample.step_s);
            let is_acting = self.gear.is_some() && sample.brake_cylinder_pressure_pa.is_some();
            let lag_s = if is_acting { 0.0 } else { self.settings.brake_lag_s };
            braking.build_up.add(known.demand, sample.step_s, lag_s);
        }
        let Some(position_m) = sample.position_m else {
            return Intake::Missing(Reason::MissingQuantity);
        };
        if sample.is_sliding && !self.settings.position_is_wheel_independent {
            return Intake::Refused(RejectionReason::WheelSlide);
        }
        let along_m = sample.direction * position_m;
        let Some(braking) = &mut self.braking else {
            let (segment, collected) = (sample.segment, Collected::from(known));
            let build_up = BuildUp::default();
            self.braking = Some(Braking { segment, origin_m: along_m, collected, build_up });
            return Intake::Start(observation(sample, 0.0, &known));
        };
        // A little less, so that jitter of the clock does not halve the rate.
        if braking.collected.step_s < 0.9 * self.settings.interval_s {
            return Intake::Collected;
        }
        let inputs = braking.collected.inputs();
        braking.collected = Collected::from(known);
        Intake::Step(inputs, observation(sample, along_m - braking.origin_m, &known))
    }

    /// Returns how much of the demanded coefficient a brake that builds up slowly lacked on the average of the braking,
    /// infinite where it still built up as many s ago; none of it says anything of the rail.
    pub fn lacking(&self, lag_s: f64) -> f64 {
        self.braking.map_or(0.0, |Braking { build_up, .. }| match build_up.built_s > lag_s {
            true => build_up.lacking_s / build_up.braked_s,
            false => f64::INFINITY,
        })
    }

    /// Returns the modelled values at a sample; `Ok(None)` while the train does not brake.
    ///
    /// A load between tare and full that no sample weighs counts as full: a train that is lighter brakes harder than
    /// its rail was asked for, and nothing looks like a slide.
    fn known(&self, sample: &ResolvedSample) -> Result<Option<Known>, Reason> {
        let sample = &match (self.full_kg, self.quantity) {
            (Some(full_kg), BrakingCoefficient::Adhesion) if !sample.is_mass_measured => {
                sample.with_mass(full_kg)
            }
            // Of another load the same braking shows another friction.
            (Some(_), _) if !sample.is_mass_measured => return Err(Reason::MissingQuantity),
            _ => *sample,
        };
        let weight_n = 1000.0 * sample.weight_kn;
        let inertial_mass_kg = sample.inertial_mass_kg;
        let brake_force_n = self.brake_force_n(sample).ok_or(Reason::MissingQuantity)?;
        let known_n_per_kn = sample.known_n_per_kn().ok_or(Reason::GradientUnknown)?;
        let is_pulling = sample
            .traction_force_n
            .is_some_and(|force_n| force_n > PULLING_MIN_PER_WEIGHT * weight_n);
        if is_pulling || brake_force_n < self.settings.braking_min_per_weight * weight_n {
            return Ok(None);
        }
        let (gain_n, demand) = match (self.quantity, self.gear) {
            (BrakingCoefficient::Adhesion, _) => (weight_n, brake_force_n / weight_n),
            (BrakingCoefficient::Friction, Some(gear)) => {
                (brake_force_n / gear.friction, gear.friction)
            }
            (BrakingCoefficient::Ratio, Some(gear)) => (brake_force_n / gear.ratio, gear.ratio),
            (_, None) => return Err(Reason::MissingQuantity),
        };
        let per_n_per_kn = sample.weight_kn / inertial_mass_kg;
        let Davis { a, b, c } = self.resistance;
        Ok(Some(Known {
            gain_mps2: gain_n / inertial_mass_kg,
            demand,
            tied_mps2: per_n_per_kn * known_n_per_kn,
            basic_mps2: [a, b, c].map(|coefficient| per_n_per_kn * coefficient),
        }))
    }

    /// Returns the force that the brake exerts as far as the rail carries it: from the cylinder pressure
    /// and the declared gear; for adhesion else the reported brake force.
    fn brake_force_n(&self, sample: &ResolvedSample) -> Option<f64> {
        let by_pressure = self
            .gear
            .zip(sample.brake_cylinder_pressure_pa)
            .map(|(gear, pressure_pa)| gear.declared_force_n(pressure_pa));
        match self.quantity {
            BrakingCoefficient::Adhesion => by_pressure.or(sample.brake_force_n),
            BrakingCoefficient::Friction | BrakingCoefficient::Ratio => by_pressure,
        }
    }
}

fn observation(sample: &ResolvedSample, distance_m: f64, known: &Known) -> BrakingObservation {
    BrakingObservation {
        distance_m,
        speed_mps: sample.speed_mps,
        is_speed_valid: !sample.is_sliding,
        demand: known.demand,
    }
}

/// The brake gear with every quantity declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeclaredGear {
    /// Brake force in N at the wheel rim per Pa of cylinder pressure, friction and ratio 1.
    force_n_per_pa: f64,
    /// Declared friction coefficient between pad and disc.
    pub friction: f64,
    /// Declared braking ratio.
    pub ratio: f64,
}

impl DeclaredGear {
    /// Returns the gear, `None` while a quantity is not declared or not positive.
    pub fn from_gear(gear: &BrakeGear) -> Option<Self> {
        let positive = |value: Option<f64>| value.filter(|v| v.is_finite() && *v > 0.0);
        let diameter_m = 1e-3 * positive(gear.cylinder_diameter_mm)?;
        let lever = positive(gear.disc_radius_mm)? / positive(gear.wheel_radius_mm)?;
        let area_m2 = std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m;
        let force_n_per_pa = lever * area_m2 * positive(gear.efficiency)? * positive(gear.pads)?;
        let (friction, ratio) = (positive(gear.friction)?, positive(gear.ratio)?);
        Some(DeclaredGear { force_n_per_pa, friction, ratio })
    }

    /// Brake force in N at a cylinder pressure in Pa.
    ///
    /// Xie 2019, eq. (4); Jin 2020, eq. (2). R_c is called a wheel diameter there, but the
    /// declared 460 mm is the radius, and only the radius belongs here. In SI units the factor
    /// of 10^-6 is gone (mm² kPa = 10^-6 kN).
    pub fn force_n(&self, pressure_pa: f64, friction: f64, ratio: f64) -> f64 {
        self.force_n_per_pa * pressure_pa.max(0.0) * friction * ratio
    }

    /// Brake force in N at a cylinder pressure in Pa with the declared friction and ratio.
    pub fn declared_force_n(&self, pressure_pa: f64) -> f64 {
        self.force_n(pressure_pa, self.friction, self.ratio)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// CRH3, table 1 of both papers, with 95 pads.
    pub(crate) fn crh3() -> BrakeGear {
        BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            ..BrakeGear::default()
        }
    }

    #[test]
    fn the_force_of_the_declared_gear_is_that_of_the_papers() {
        // In mm, kPa and kN, as printed.
        let area_mm2 = std::f64::consts::FRAC_PI_4 * 203.0 * 203.0;
        let printed_kn = area_mm2 * (297.6 / 460.0) * 410.0 * 0.85 * 2.55 * 0.28 * 95.0 * 1e-6;
        let gear = DeclaredGear::from_gear(&crh3()).unwrap();
        assert!((gear.declared_force_n(410_000.0) - 1000.0 * printed_kn).abs() < 1e-6);
        // B/(Mg) as a check on the number of pads, which the papers do not give.
        assert!((printed_kn / (536.0 * 9.8) - 0.0942).abs() < 5e-5);
    }

    #[test]
    fn an_unweighed_train_between_tare_and_full_counts_as_full_and_shows_no_friction() {
        let full_kg = 500e3;
        let train = TrainModel {
            full_mass_kg: Some(full_kg),
            brake_gear: crh3(),
            ..TrainModel::bare("", 300e3, Davis { a: 1.0, b: 0.0, c: 0.0 })
        };
        let mut sample = ResolvedSample::coasting().with_mass(train.mass_kg);
        sample.brake_force_n = Some(2e5);
        sample.traction_force_n = Some(0.0);
        let known = |quantity, sample: &ResolvedSample| {
            let settings = BrakingSettings::default();
            BrakingIntake::new(quantity, settings, &train).known(sample)
        };
        let demand = |sample: &ResolvedSample| {
            known(BrakingCoefficient::Adhesion, sample).unwrap().unwrap().demand
        };
        let full = 2e5 / (1000.0 * TrainModel::weight_kn(full_kg));
        assert!((demand(&sample) - full).abs() < 1e-12);
        sample.brake_cylinder_pressure_pa = Some(2e5);
        assert_eq!(known(BrakingCoefficient::Friction, &sample), Err(Reason::MissingQuantity));
        sample.brake_cylinder_pressure_pa = None;
        sample.is_mass_measured = true;
        let own = 2e5 / (1000.0 * TrainModel::weight_kn(train.mass_kg));
        assert!((demand(&sample) - own).abs() < 1e-12, "weighed");
    }

    #[test]
    fn a_gear_with_a_hole_is_not_declared() {
        let without_pads = BrakeGear { pads: None, ..crh3() };
        assert_eq!(DeclaredGear::from_gear(&without_pads), None);
        let negative = BrakeGear { ratio: Some(-1.0), ..crh3() };
        assert_eq!(DeclaredGear::from_gear(&negative), None);
    }

    #[test]
    fn a_pressure_below_zero_exerts_no_force() {
        let gear = DeclaredGear::from_gear(&crh3()).unwrap();
        assert_eq!(gear.declared_force_n(-2_000.0), 0.0);
    }
}
