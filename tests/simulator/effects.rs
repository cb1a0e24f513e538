//! Each effect changes its own quantities and no others, and its size matters.

use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::disturbances::Disturbances;
use dynocar_tests::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, oracle, simulate,
};

const SEED: u64 = 11;

fn kinds() -> impl Iterator<Item = EffectKind> {
    EffectKind::ALL.iter().copied().filter(|&kind| kind != EffectKind::None)
}

fn ideal(kinds: &[EffectKind], seed: u64) -> SimulatedDataset {
    simulate(&SimulatorSettings {
        runs: 6,
        duration_s: 450.0,
        ..SimulatorSettings::ideal(seed, EffectRequest::Kinds(kinds.to_vec()))
    })
}

/// Returns the same train and line without effects.
fn null_of(dataset: &SimulatedDataset) -> SimulatedDataset {
    simulate(&SimulatorSettings {
        train_type: Some(dataset.train.train_type),
        effects: EffectRequest::none(),
        ..dataset.settings.clone()
    })
}

/// Resets the quantities that an effect of this kind may change.
fn undo(kind: EffectKind, disturbances: &mut Disturbances, neutral: &Disturbances) {
    let neutral = neutral.clone();
    let d = disturbances;
    match kind {
        EffectKind::None => {}
        EffectKind::TunnelDrag => d.tunnel_c_factor = neutral.tunnel_c_factor,
        EffectKind::CurveResistance => {
            d.curve_constant_n_per_kn_m = neutral.curve_constant_n_per_kn_m;
        }
        EffectKind::Wind => {
            (d.headwind_mps, d.gust_sd_mps) = (neutral.headwind_mps, neutral.gust_sd_mps);
        }
        EffectKind::DraggingBrake => {
            d.drag_force_n = neutral.drag_force_n;
            d.drag_windows = neutral.drag_windows;
            d.residual_pressure_pa = neutral.residual_pressure_pa;
        }
        EffectKind::WheelDiameter => d.speed_scale = neutral.speed_scale,
        EffectKind::GradientShift => {
            d.gradient = neutral.gradient;
            d.gradient_shift_m = neutral.gradient_shift_m;
        }
        EffectKind::GradientError => {
            d.gradient = neutral.gradient;
            d.gradient_error = neutral.gradient_error;
        }
        EffectKind::MassChange => {
            d.mass_sections = neutral.mass_sections;
            d.mass_windows = neutral.mass_windows;
        }
        EffectKind::TractionGain => d.traction_gain = neutral.traction_gain,
        EffectKind::BrakeGain => d.brake_gain = neutral.brake_gain,
        EffectKind::BrakeDelay => d.brake_late_s = neutral.brake_late_s,
        EffectKind::ActuatorDelay => (d.delay_s, d.lag_s) = (neutral.delay_s, neutral.lag_s),
        EffectKind::SpeedDelay => {
            (d.speed_delay_s, d.speed_lag_s) = (neutral.speed_delay_s, neutral.speed_lag_s);
        }
        EffectKind::RotatingMass => d.rotating_mass_factor = neutral.rotating_mass_factor,
        EffectKind::BearingTemperature => d.cold_bearings = neutral.cold_bearings,
        EffectKind::AmbientTemperature => d.ambient = neutral.ambient,
        EffectKind::LocalResistance => d.local = neutral.local,
        EffectKind::LowAdhesion => d.adhesion = neutral.adhesion,
        EffectKind::Unknown => d.unlisted = neutral.unlisted,
    }
}

#[test]
fn an_effect_changes_what_it_should_and_nothing_else() {
    for kind in kinds() {
        let dataset = ideal(&[kind], SEED);
        let null = null_of(&dataset);
        assert_eq!(dataset.train, null.train, "{kind}");
        assert_eq!(dataset.sensors, null.sensors, "{kind}");
        if kind != EffectKind::TunnelDrag {
            assert_eq!(dataset.line, null.line, "{kind}");
        }
        let mut changed = 0;
        for (run, null_run) in dataset.runs.iter().zip(&null.runs) {
            assert_eq!(run.plan, null_run.plan, "{kind}");
            let mut disturbances = run.disturbances.clone();
            changed += usize::from(disturbances != null_run.disturbances);
            undo(kind, &mut disturbances, &null_run.disturbances);
            assert_eq!(disturbances, null_run.disturbances, "{kind}");
        }
        assert!(changed >= 3, "{kind}: changes {changed} runs");
    }
}

#[test]
fn effects_of_sensors_leave_the_motion_as_it_was() {
    for kind in [EffectKind::WheelDiameter, EffectKind::TractionGain, EffectKind::SpeedDelay] {
        let dataset = ideal(&[kind], SEED);
        let null = null_of(&dataset);
        for (run, null_run) in dataset.runs.iter().zip(&null.runs) {
            for (state, null_state) in run.states.iter().zip(&null_run.states) {
                assert_eq!(state.speed_mps, null_state.speed_mps, "{kind}");
                assert_eq!(state.acting, null_state.acting, "{kind}");
            }
            assert_ne!(run.samples, null_run.samples, "{kind}");
        }
    }
}

#[test]
fn a_wrong_wheel_diameter_scales_speed_and_odometer_between_balises() {
    let dataset = ideal(&[EffectKind::WheelDiameter], SEED);
    let run = &dataset.runs[0];
    let scale = run.disturbances.speed_scale;
    assert!((scale - 1.0).abs() >= 0.01);
    let mut fixes = 0;
    for (pair, states) in run.samples.windows(2).zip(run.states.windows(5).step_by(4)) {
        assert!((pair[0].speed_mps - scale * states[0].speed_mps).abs() < 1e-9);
        let shown_m = (pair[1].position_m - pair[0].position_m).abs();
        let true_m = (states[4].position_m - states[0].position_m).abs();
        if (shown_m - scale * true_m).abs() > 1e-3 + 0.01 * true_m {
            fixes += 1;
        }
    }
    assert!((3..200).contains(&fixes), "{fixes} corrections at balises");
}

#[test]
fn every_effect_matters_and_its_true_parameters_explain_it() {
    for kind in kinds() {
        let dataset = ideal(&[kind], SEED);
        let score = oracle::score(&dataset).full_run;
        // Gusts are no parameter, and a wrong odometer misplaces the track.
        let tolerance_mps = match kind {
            EffectKind::Wind | EffectKind::WheelDiameter => 0.15,
            _ => 0.03,
        };
        assert!(score.true_mps < tolerance_mps, "{kind}: {score:?}");
        assert!(score.declared_mps > 0.15, "{kind}: {score:?}");
        assert!(score.declared_mps > 4.0 * score.true_mps, "{kind}: {score:?}");
    }
}

#[test]
fn undeclared_forces_are_a_few_to_forty_percent_of_the_resistance() {
    use EffectKind::{
        AmbientTemperature, BearingTemperature, CurveResistance, DraggingBrake, LocalResistance,
        TunnelDrag, Unknown, Wind,
    };
    let forces = [
        TunnelDrag,
        CurveResistance,
        Wind,
        DraggingBrake,
        BearingTemperature,
        AmbientTemperature,
        LocalResistance,
        Unknown,
    ];
    for kind in forces {
        for seed in 0..4 {
            let share = ideal(&[kind], seed).extra_force_share();
            assert!((0.02..0.4).contains(&share), "{kind}, seed {seed}: {share}");
        }
    }
    assert_eq!(ideal(&[], 0).extra_force_share(), 0.0);
}

#[test]
fn two_effects_act_together() {
    let pair = [EffectKind::CurveResistance, EffectKind::TractionGain];
    let both = ideal(&pair, SEED);
    assert_eq!(both.effects.iter().map(|effect| effect.kind()).collect::<Vec<_>>(), pair);
    let only = |effects: &[dynocar_tests::simulator::TrueEffect]| {
        let settings = SimulatorSettings {
            train_type: Some(both.train.train_type),
            effects: EffectRequest::Exactly(effects.to_vec()),
            ..both.settings.clone()
        };
        simulate(&settings)
    };
    let score = oracle::score(&both).full_run;
    assert!(score.true_mps < 0.03 && score.declared_mps > 0.1, "{score:?}");
    // Either alone gives another recording.
    for effect in &both.effects {
        let alone = only(std::slice::from_ref(effect));
        assert_eq!(alone.train, both.train);
        assert_ne!(alone.runs[0].samples, both.runs[0].samples);
    }
    assert_eq!(only(&both.effects).runs, both.runs);
}

#[test]
fn every_combination_of_two_kinds_can_be_simulated() {
    let all: Vec<EffectKind> = kinds().collect();
    for (k, &one) in all.iter().enumerate() {
        let other = all[(k + 5) % all.len()];
        let settings = SimulatorSettings {
            runs: 3,
            holdout_runs: 1,
            duration_s: 300.0,
            ..SimulatorSettings::new(k as u64, EffectRequest::Kinds(vec![one, other]))
        };
        let dataset = simulate(&settings);
        assert_eq!(dataset.effects.len(), 2, "{one} and {other}");
        let score = oracle::score(&dataset).full_run;
        assert!(
            score.declared_mps.is_finite() && score.true_mps < 1.0,
            "{one}, {other}: {score:?}"
        );
    }
}

#[test]
fn what_nobody_declares_differs_from_run_to_run_and_stays_small() {
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Regional),
        ..SimulatorSettings::new(SEED, EffectRequest::none())
    };
    let dataset = simulate(&settings);
    let factors: Vec<f64> =
        dataset.runs.iter().map(|run| run.disturbances.resistance_factor).collect();
    assert!(factors.iter().all(|factor| (factor - 1.0).abs() < 0.05));
    assert!(factors.windows(2).all(|pair| pair[0] != pair[1]));
    assert!(ideal(&[], SEED).runs.iter().all(|run| run.disturbances.resistance_factor == 1.0));
}
