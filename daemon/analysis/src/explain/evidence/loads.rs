//! Loads that nobody weighed, of a train that declares tare and full load: between two stops, the mass that the traction
//! force moves.
//!
//! While the train pulls, the impulse of the force is the mass times the gain that the motion shows: the change of
//! speed with the rotating mass, the climb, and the declared resistance. Where it hardly pulls, the mass is the middle of
//! the declared range.

use dynocar_model::force::ResolvedSample;
use dynocar_model::simulate::STANDING_MPS;
use dynocar_model::train::TrainModel;
use dynocar_shared::resistance::GRAVITY_MPS2;

/// Standing in s at which the load may change.
const STOP_MIN_S: f64 = 1.0;
/// Speed in m/s from which the brake that held the train has released.
const RELEASED_MPS: f64 = 0.5;
/// Force over weight that counts as pulling, or as braking.
const FORCE_SHARE: f64 = 0.01;
/// Standard deviation in m/s of the speed gained under traction, and its share: sensors, gradients, late forces.
const GAIN_STD_MPS: f64 = 0.1;
const GAIN_STD_SHARE: f64 = 0.02;
/// Share of tare and full load up to which a train may be lighter or heavier than declared.
const BEYOND_RANGE: f64 = 0.12;

/// The samples between two stops, from the first to the one behind the last.
type Leg = std::ops::Range<usize>;

/// Puts the load of each leg into its samples, where the train declares a range and no sample of the run is weighed;
/// true where it did.
pub fn estimate_loads(train: &TrainModel, samples: &mut [ResolvedSample]) -> bool {
    let Some((middle_kg, std_kg)) = train.load_range() else { return false };
    if samples.iter().any(|it| it.is_mass_measured) {
        return false;
    }
    let full_kg = train.full_mass_kg.unwrap_or(train.mass_kg);
    let bounds = ((1.0 - BEYOND_RANGE) * train.mass_kg, (1.0 + BEYOND_RANGE) * full_kg);
    for leg in legs(samples) {
        let (impulse_ns, gain_mps) = pulled(train, &samples[leg.clone()]);
        let noise_ns = middle_kg * GAIN_STD_MPS.hypot(GAIN_STD_SHARE * gain_mps);
        let (of_force, of_range) = (noise_ns.powi(-2), std_kg.powi(-2));
        let sum = gain_mps * impulse_ns * of_force + middle_kg * of_range;
        let mass_kg = sum / (gain_mps * gain_mps * of_force + of_range);
        for sample in &mut samples[leg] {
            *sample = sample.with_mass(mass_kg.clamp(bounds.0, bounds.1));
        }
    }
    true
}

/// Returns the parts of a run between stops; a stop belongs to the part before it.
fn legs(samples: &[ResolvedSample]) -> Vec<Leg> {
    let mut legs = Vec::new();
    let (mut first, mut stood_s) = (0, 0.0);
    for (i, sample) in samples.iter().enumerate() {
        if sample.speed_mps <= STANDING_MPS {
            stood_s += sample.step_s;
            continue;
        }
        let is_apart = i > 0 && samples[i - 1].segment != sample.segment;
        if i > first && (stood_s >= STOP_MIN_S || is_apart) {
            legs.push(first..i);
            first = i;
        }
        stood_s = 0.0;
    }
    legs.push(first..samples.len());
    legs
}

/// Returns the impulse in N s of the traction force of a leg, and the speed in m/s that it would have given a mass
/// without resistances.
fn pulled(train: &TrainModel, samples: &[ResolvedSample]) -> (f64, f64) {
    let rate = |sample: &ResolvedSample| {
        let least_n = FORCE_SHARE * 1000.0 * sample.weight_kn;
        let force_n = sample.traction_force_n.filter(|it| *it > least_n)?;
        let is_braking = sample.brake_force_n.is_some_and(|it| it > least_n);
        let known_n_per_kn = sample.known_n_per_kn()?;
        let retarding = known_n_per_kn + train.resistance.w0_n_per_kn(sample.speed_mps);
        let pulls = !is_braking && sample.speed_mps >= RELEASED_MPS;
        pulls.then_some((force_n, 1e-3 * GRAVITY_MPS2 * retarding))
    };
    let (mut impulse_ns, mut gain_mps) = (0.0, 0.0);
    for pair in samples.windows(2) {
        let (before, now) = (&pair[0], &pair[1]);
        let (Some(from), Some(to)) = (rate(before), rate(now)) else { continue };
        if before.segment != now.segment {
            continue;
        }
        let half_s = 0.5 * now.step_s;
        impulse_ns += half_s * (from.0 + to.0);
        let change_mps = now.speed_mps - before.speed_mps;
        gain_mps += (1.0 + train.rotating_mass_factor) * change_mps + half_s * (from.1 + to.1);
    }
    (impulse_ns, gain_mps)
}

#[cfg(test)]
mod tests {
    use dynocar_model::train::Davis;

    use super::*;

    /// A train of 40 to 60 t that pulls with 50 kN for 20 s from each stop and coasts for 20 s, with another mass in t
    /// after each stop.
    fn run(masses_t: &[f64]) -> (TrainModel, Vec<ResolvedSample>) {
        let resistance = Davis { a: 3.0, b: 0.05, c: 0.002 };
        let train = TrainModel {
            full_mass_kg: Some(60e3),
            rotating_mass_factor: 0.06,
            ..TrainModel::bare("tram", 40e3, resistance)
        };
        let mut samples = Vec::new();
        for &mass_t in masses_t {
            let mass_kg = 1000.0 * mass_t;
            let (mut speed_mps, step_s) = (0.0, 0.1);
            for step in 0..500 {
                let force_n = if (50..250).contains(&step) { 50e3 } else { 0.0 };
                let standing = !(50..450).contains(&step);
                let mut sample = ResolvedSample::coasting();
                sample.speed_mps = if standing { 0.0 } else { speed_mps };
                (sample.time_ns, sample.step_s) = (samples.len() as i64 * 100_000_000, step_s);
                (sample.gradient_permille, sample.extra_n_per_kn) = (Some(5.0), 0.0);
                (sample.traction_force_n, sample.brake_force_n) = (Some(force_n), Some(0.0));
                samples.push(sample.with_mass(train.mass_kg));
                let retarding = 5.0 + resistance.w0_n_per_kn(speed_mps);
                let free_n = force_n - retarding * TrainModel::weight_kn(mass_kg);
                speed_mps += if standing { 0.0 } else { step_s * free_n / (1.06 * mass_kg) };
            }
        }
        (train, samples)
    }

    #[test]
    fn each_leg_has_the_mass_that_its_traction_moves() {
        let masses_t = [42.0, 58.0, 49.0];
        let (train, mut samples) = run(&masses_t);
        assert!(estimate_loads(&train, &mut samples));
        for (leg, mass_t) in masses_t.into_iter().enumerate() {
            let found_t = 1e-3 * samples[500 * leg + 200].mass_kg;
            assert!((found_t - mass_t).abs() < 0.01 * mass_t, "{found_t} for {mass_t}");
        }
    }

    #[test]
    fn a_leg_without_traction_has_the_middle_and_a_weighed_train_its_weight() {
        let (train, mut samples) = run(&[42.0]);
        samples.iter_mut().for_each(|it| it.traction_force_n = Some(0.0));
        assert!(estimate_loads(&train, &mut samples));
        assert!((samples[200].mass_kg - 50e3).abs() < 1.0);
        samples[0].is_mass_measured = true;
        assert!(!estimate_loads(&train, &mut samples), "weighed");
        let undeclared = TrainModel { full_mass_kg: None, ..train };
        samples[0].is_mass_measured = false;
        assert!(!estimate_loads(&undeclared, &mut samples), "no range");
    }
}
