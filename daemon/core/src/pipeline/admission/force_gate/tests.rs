//! The gate on single samples and on runs of samples.

use super::*;
use rand::{RngExt, SeedableRng};

const STEP_S: f64 = 0.2;
/// Force in N that is 1 N/kN on the train.
const UNIT_N: f64 = 981.0;

/// Returns a sample of a train of 100 t on the level, at 20 m/s.
fn sample(index: usize, force_n_per_kn: f64) -> ResolvedSample {
    ResolvedSample {
        time_ns: index as i64 * 200_000_000,
        step_s: if index == 0 { 0.0 } else { STEP_S },
        position_m: Some(4.0 * index as f64),
        traction_force_n: Some(force_n_per_kn.max(0.0) * UNIT_N),
        brake_force_n: Some((-force_n_per_kn).max(0.0) * UNIT_N),
        ..ResolvedSample::coasting()
    }
}

/// Times in s and forces in N/kN of the samples taken, with the steps that lead to them.
fn taken(gate: &mut ForceGate, samples: &[ResolvedSample]) -> Vec<(f64, f64, f64)> {
    let mut all = Vec::new();
    for it in samples {
        let figures = |it: &ResolvedSample| {
            let force = it.control_force_n().unwrap() / UNIT_N;
            (1e-9 * it.time_ns as f64, force.round(), it.step_s)
        };
        match gate.judge(it) {
            GateVerdict::Take => all.push(figures(it)),
            GateVerdict::Release(count) => {
                all.extend((0..count).map(|index| figures(&gate.released(index).unwrap())));
            }
            GateVerdict::Wait | GateVerdict::Refuse(_) => {}
        }
    }
    all
}

fn samples(forces_n_per_kn: &[f64]) -> Vec<ResolvedSample> {
    forces_n_per_kn.iter().enumerate().map(|(index, &force)| sample(index, force)).collect()
}

#[test]
fn changes_and_ramps_lose_no_sample() {
    let mut forces = vec![50.0; 20];
    forces.extend((0..15).map(|k| 50.0 - 6.0 * f64::from(k)));
    forces.extend([-34.0; 10]);
    // A gradient that comes and goes.
    forces.extend([-35.4, -34.8, -34.2, -34.0, -34.0]);
    forces.extend([20.0; 10]);
    let all = taken(&mut ForceGate::default(), &samples(&forces));
    assert_eq!(all.len(), forces.len());
    assert!(all[1..].iter().all(|&(_, _, step_s)| step_s == STEP_S));
    assert!(all.is_sorted_by(|one, next| one.0 < next.0));
}

#[test]
fn noisy_forces_are_taken_once_their_noise_is_known() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
    let forces: Vec<f64> =
        (0..1500).map(|_| 40.0 + 12.0 * (random.random::<f64>() - 0.5)).collect();
    let samples = samples(&forces);
    let mut gate = ForceGate::default();
    taken(&mut gate, &samples[..500]);
    assert_eq!(taken(&mut gate, &samples[500..]).len(), 1000);
}

#[test]
fn a_new_gate_takes_noise_for_no_fault() {
    for noise_n_per_kn in [1.0, 3.0, 10.0, 30.0] {
        for seed in 0..20 {
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let forces: Vec<f64> =
                (0..200).map(|_| 40.0 + noise_n_per_kn * (random.random::<f64>() - 0.5)).collect();
            let mut gate = ForceGate::default();
            let mut is_doubted = false;
            for sample in samples(&forces) {
                gate.judge(&sample);
                is_doubted |= gate.is_in_doubt();
            }
            assert!(!is_doubted, "noise of {noise_n_per_kn} N/kN, seed {seed}");
        }
    }
}

#[test]
fn forces_that_stand_alone_are_bridged() {
    let mut forces = vec![40.0; 30];
    forces[10] = 0.0;
    (forces[20], forces[21]) = (95.0, 60.0);
    let all = taken(&mut ForceGate::default(), &samples(&forces));
    assert_eq!(all.len(), 27);
    assert!(all.iter().all(|&(_, force, _)| force == 40.0));
    let total_s: f64 = all.iter().map(|&(_, _, step_s)| step_s).sum();
    assert!((total_s - 29.0 * STEP_S).abs() < 1e-9, "no time is lost: {total_s}");
}

#[test]
fn a_first_sample_that_nothing_agrees_with_begins_nothing() {
    let all = taken(&mut ForceGate::default(), &samples(&[90.0, 30.0, 30.0, 30.0, 30.0]));
    let steps: Vec<f64> = all.iter().map(|&(_, _, step_s)| step_s).collect();
    assert_eq!(steps, [0.0, 0.0, STEP_S, STEP_S, STEP_S]);
}

#[test]
fn where_many_forces_stand_alone_none_is_taken_until_they_are_steady() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let any = |k: usize| if k < 500 && random.random::<bool>() { 60.0 } else { 120.0 };
    let samples: Vec<_> = (0..1000).map(any).enumerate().map(|(k, f)| sample(k, f)).collect();
    let mut gate = ForceGate::default();
    let early = taken(&mut gate, &samples[..500]);
    assert!(gate.is_in_doubt() && early.len() < 40, "{}", early.len());
    assert!(gate.is_in_doubt());
    let late = taken(&mut gate, &samples[500..]);
    assert!(!gate.is_in_doubt() && late.len() > 150, "{}", late.len());
}

#[test]
fn what_a_moving_train_repeats_place_and_all_shows_nothing() {
    let mut samples = samples(&[40.0; 60]);
    let held = samples[10];
    let frozen = |samples: &mut [ResolvedSample]| {
        for it in samples {
            (it.position_m, it.speed_mps) = (held.position_m, held.speed_mps);
        }
    };
    frozen(&mut samples[10..15]);
    let all = taken(&mut ForceGate::default(), &samples);
    assert_eq!(all.len(), 56);
    assert!((all[11].2 - 5.0 * STEP_S).abs() < 1e-9, "bridged");
    frozen(&mut samples[15..40]);
    let mut gate = ForceGate::default();
    let all = taken(&mut gate, &samples);
    assert_eq!(all.len(), 31);
    assert_eq!(all[11].2, 0.0, "after seconds of it the motion begins anew");
    let mut gate = ForceGate::default();
    let verdicts: Vec<_> = samples[..40].iter().map(|it| gate.judge(it)).collect();
    assert_eq!(verdicts[39], GateVerdict::Refuse(RejectionReason::Repeated));
    // A train that says nothing of its place may well hold its speed.
    samples.iter_mut().for_each(|it| it.position_m = None);
    assert_eq!(taken(&mut ForceGate::default(), &samples).len(), 60);
}

#[test]
fn a_speed_that_no_train_reaches_and_leaves_within_a_sample_is_bridged() {
    let mut samples = samples(&[0.0; 20]);
    samples[8].speed_mps = 18.7;
    assert_eq!(taken(&mut ForceGate::default(), &samples).len(), 19);
}

#[test]
fn samples_that_cannot_be_judged_pass_to_the_estimator() {
    let mut gate = ForceGate::default();
    let odd = [
        ResolvedSample { traction_force_n: None, ..sample(1, 0.0) },
        ResolvedSample { gradient_permille: Some(f64::NAN), ..sample(1, 0.0) },
        ResolvedSample { speed_mps: f64::NAN, ..sample(1, 0.0) },
        ResolvedSample { weight_kn: 0.0, ..sample(1, 0.0) },
        ResolvedSample { is_sliding: true, ..sample(1, 0.0) },
        ResolvedSample { step_s: f64::NAN, ..sample(1, 0.0) },
        ResolvedSample { segment: 9, ..sample(1, 0.0) },
    ];
    for it in odd {
        gate.judge(&sample(0, 50.0));
        assert_eq!(gate.judge(&it), GateVerdict::Take, "{it:?}");
    }
}
