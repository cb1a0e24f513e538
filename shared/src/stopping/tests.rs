//! Stopping distances against closed forms, the papers' figures and sampled stops.

use crate::quantile::normal_quantile;
use crate::resistance::GRAVITY_MPS2;
use crate::snapshot::packed_index;
use crate::{
    BrakeResponse, EffortPoint, Parameter, ParameterSnapshot, RailAdhesion, RailCondition, Stop,
    StoppingError, StoppingEstimate, Uncertain,
};

const NO_RESISTANCE: [f64; 3] = [0.0, 0.0, 0.0];
const KMH: f64 = 1.0 / 3.6;

fn constant(force_n: f64) -> [EffortPoint; 1] {
    [EffortPoint { speed_mps: 0.0, force_n }]
}

/// CRH3 Davis coefficients, given in km/h.
const CRH3_DAVIS: [f64; 3] = [0.79, 0.0064 * 3.6, 0.000_115 * 3.6 * 3.6];
const CRH3_MASS_KG: f64 = 536_000.0;

/// Brake force in N by Xie 2019, eq. (4), table 1, with 95 pads.
fn crh3_brake_n(friction: f64) -> f64 {
    let area_mm2 = std::f64::consts::FRAC_PI_4 * 203.0 * 203.0;
    297.6 / 460.0 * area_mm2 * 410.0 * 0.85 * 2.55 * friction * 95.0 * 1e-3
}

fn xie(from_kmh: f64, to_kmh: f64, adhesion: RailAdhesion) -> StoppingEstimate {
    let effort = constant(crh3_brake_n(0.28));
    let stop = Stop {
        to_speed_mps: to_kmh * KMH,
        adhesion,
        gravity_mps2: 9.8,
        ..Stop::level(from_kmh * KMH, CRH3_MASS_KG, CRH3_DAVIS, &effort)
    };
    stop.estimate(0.95).unwrap()
}

#[test]
fn constant_deceleration_gives_the_textbook_distance_and_time() {
    let effort = constant(100_000.0);
    let stop = Stop {
        gradient_permille: 20.0,
        rotating_mass_factor: 0.1,
        ..Stop::level(40.0, 100_000.0, NO_RESISTANCE, &effort)
    };
    let deceleration = (1.0 + 0.020 * 9.81) / 1.1;
    let found = stop.estimate(0.95).unwrap();
    assert!((found.distance_m - 800.0 / deceleration).abs() < 1e-9);
    assert!((found.time_s - 40.0 / deceleration).abs() < 1e-10);
    assert_eq!(found.distance_bound_m, found.distance_m);
}

#[test]
fn air_drag_gives_the_closed_form() {
    // dv/dt = -(d + k v²): distance ln(1 + k v²/d) / 2k, time atan(v sqrt(k/d)) / sqrt(k d).
    let (d, k) = (0.6_f64, 2e-4_f64);
    let effort = constant(d * 50_000.0);
    let davis = [0.0, 0.0, k * 1000.0 / 9.81];
    let found = Stop::level(90.0, 50_000.0, davis, &effort).estimate(0.9).unwrap();
    assert!((found.distance_m - (1.0 + k * 8100.0 / d).ln() / (2.0 * k)).abs() < 1e-6);
    assert!((found.time_s - (90.0 * (k / d).sqrt()).atan() / (k * d).sqrt()).abs() < 1e-7);
}

#[test]
fn stops_of_xie_2019_figures_10_and_11_follow() {
    // Figures of an independent integration in time; in brackets those of the paper.
    let cases = [
        (RailAdhesion::Coefficient(Uncertain::exact(0.1542)), 3085.5, 56.0), // 3060.7, 56.1
        (RailAdhesion::Coefficient(Uncertain::exact(0.0726)), 3916.4, 71.3), // 3946.7, 71.7
        (RailAdhesion::Law(RailCondition::Wet, Uncertain::exact(1.0)), 3525.5, 62.6), // 3481.1, 62.8
    ];
    for (adhesion, distance_m, time_s) in cases {
        let found = xie(300.0, 100.0, adhesion);
        assert!((found.distance_m - distance_m).abs() < 0.2, "{found:?}");
        assert!((found.time_s - time_s).abs() < 0.05, "{found:?}");
    }
}

#[test]
fn stop_of_jin_2020_figure_8_follows() {
    // 94.2 s and 4647.16 m in the paper, with the friction curve reconstructed from its figure 2.
    let effort: Vec<EffortPoint> = (0..=350)
        .map(|kmh| {
            let kmh = f64::from(kmh);
            let notch = 0.06 * (-((kmh - 180.0) / 28.0).powi(2)).exp();
            let friction = 0.30331 - 0.03846 * (kmh - 175.0) / 175.0 - notch;
            EffortPoint { speed_mps: kmh * KMH, force_n: crh3_brake_n(friction) }
        })
        .collect();
    let stop =
        Stop { gravity_mps2: 9.8, ..Stop::level(350.0 * KMH, CRH3_MASS_KG, CRH3_DAVIS, &effort) };
    let found = stop.estimate(0.95).unwrap();
    assert!((found.distance_m - 4647.2).abs() < 0.2, "{found:?}");
    assert!((found.time_s - 94.20).abs() < 0.02, "{found:?}");
}

#[test]
fn the_bound_holds_with_the_chosen_confidence() {
    let adhesion = Uncertain::new(0.08, 0.01);
    let confidence = 0.95;
    let bound_m = xie(300.0, 0.0, RailAdhesion::Coefficient(adhesion)).distance_bound_m;
    let draws = 2000;
    let held = (0..draws)
        .filter(|&i| {
            // Stratified draws from the distribution of the coefficient.
            let z = normal_quantile((f64::from(i) + 0.5) / f64::from(draws)).unwrap();
            let drawn = Uncertain::exact(adhesion.value + z * adhesion.std);
            xie(300.0, 0.0, RailAdhesion::Coefficient(drawn)).distance_m <= bound_m
        })
        .count();
    assert!((held as f64 / f64::from(draws) - confidence).abs() < 1e-3, "{held}");
}

#[test]
fn two_uncertain_quantities_are_bounded_together() {
    // The rail and the brake are equally strong on average, the worst case for a linear bound.
    let weight_n = CRH3_MASS_KG * 9.81;
    let effort = constant(0.08 * weight_n);
    let given = |brake, adhesion| Stop {
        brake_scale: brake,
        adhesion: RailAdhesion::Coefficient(adhesion),
        ..Stop::level(80.0, CRH3_MASS_KG, CRH3_DAVIS, &effort)
    };
    let bound_m = given(Uncertain::new(1.0, 0.1), Uncertain::new(0.08, 0.008))
        .estimate(0.95)
        .unwrap()
        .distance_bound_m;
    let grid: Vec<f64> =
        (0..40).map(|i| normal_quantile((f64::from(i) + 0.5) / 40.0).unwrap()).collect();
    let held = grid
        .iter()
        .flat_map(|&x| grid.iter().map(move |&y| (x, y)))
        .filter(|&(x, y)| {
            let drawn = given(Uncertain::exact(1.0 + 0.1 * x), Uncertain::exact(0.08 + 0.008 * y));
            drawn.estimate(0.95).unwrap().distance_m <= bound_m
        })
        .count();
    let share = held as f64 / 1600.0;
    assert!((0.95..0.96).contains(&share), "{share}");
}

#[test]
fn bad_input_is_named() {
    let effort = constant(100_000.0);
    let good = Stop::level(40.0, 100_000.0, NO_RESISTANCE, &effort);
    let named = |stop: Stop<'_>| match stop.estimate(0.95) {
        Err(StoppingError::BadInput { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(named(Stop { from_speed_mps: f64::NAN, ..good }), "from_speed_mps");
    assert_eq!(named(Stop { to_speed_mps: 50.0, ..good }), "from_speed_mps");
    assert_eq!(named(Stop { mass_kg: 0.0, ..good }), "mass_kg");
    let in_t = Stop { mass_kg: 100.0, ..good };
    assert_eq!(named(in_t), "mass_kg");
    // The adhesion limits the deceleration of a brake of any force.
    let carried = RailAdhesion::Coefficient(Uncertain::exact(0.1));
    assert!(Stop { adhesion: carried, ..in_t }.estimate(0.95).is_ok());
    let percent = RailAdhesion::Coefficient(Uncertain::exact(15.0));
    assert_eq!(named(Stop { adhesion: percent, ..good }), "adhesion");
    let in_kn = constant(100.0);
    assert_eq!(named(Stop { brake_effort: &in_kn, ..good }), "brake_effort");
    assert_eq!(named(Stop { brake_effort: &[], ..good }), "brake_effort");
    assert_eq!(named(Stop { brake_scale: Uncertain::new(1.0, f64::NAN), ..good }), "brake_scale");
    let backwards = [effort[0], EffortPoint { speed_mps: -1.0, force_n: 0.0 }];
    assert_eq!(named(Stop { brake_effort: &backwards, ..good }), "brake_effort");
    assert!(good.estimate(1.0).is_err());
}

#[test]
fn a_train_that_does_not_slow_down_has_no_stopping_distance() {
    let effort = constant(100_000.0);
    let downhill =
        Stop { gradient_permille: -120.0, ..Stop::level(40.0, 100_000.0, NO_RESISTANCE, &effort) };
    let error = downhill.estimate(0.95).unwrap_err();
    assert_eq!(error, StoppingError::DoesNotStop { speed_mps: 0.0, in_bound: false });
    let uncertain = Stop {
        brake_scale: Uncertain::new(1.0, 0.5),
        ..Stop::level(40.0, 100_000.0, NO_RESISTANCE, &effort)
    };
    let error = uncertain.estimate(0.99).unwrap_err();
    assert_eq!(error, StoppingError::DoesNotStop { speed_mps: 0.0, in_bound: true });
    assert_eq!(
        error.to_string(),
        "the train does not slow down at 0 m/s at the edge of the confidence bound"
    );
}

#[test]
fn adhesion_learned_at_the_end_of_a_braking_does_not_shorten_the_next_one_from_full_speed() {
    let (law, share) = (RailCondition::Wet, 0.7);
    let end_mps = 4.0;
    let mut snapshot = ParameterSnapshot::empty();
    snapshot.parameter_count = 1;
    snapshot.parameters[0] = Parameter::Adhesion as u32;
    snapshot.values[0] = share * law.adhesion(end_mps);
    snapshot.covariance[packed_index(0, 0)] = 1e-6;
    snapshot.speed_min_mps = end_mps;
    let effort = constant(1e9);
    let from = |adhesion: RailAdhesion| {
        let stop = Stop { adhesion, ..Stop::level(40.0, 1e5, NO_RESISTANCE, &effort) };
        stop.estimate(0.99).unwrap()
    };
    let truth = from(RailAdhesion::Law(law, Uncertain::exact(share)));
    let learned = from(RailAdhesion::learned(&snapshot).unwrap());
    assert!((learned.distance_m / truth.distance_m - 1.0).abs() < 1e-9, "{learned:?} {truth:?}");
    assert!(learned.distance_bound_m > truth.distance_m);
    // Read as one coefficient at all speeds it is a promise that the rail does not keep.
    let naive = from(RailAdhesion::Coefficient(Uncertain::new(snapshot.values[0], 1e-3)));
    assert!(naive.distance_bound_m < 0.85 * truth.distance_m, "{naive:?}");
    // Along the wet law a dry rail carries less than it does.
    snapshot.values[0] = RailCondition::Dry.adhesion(end_mps);
    let dry = from(RailAdhesion::Law(RailCondition::Dry, Uncertain::exact(1.0)));
    assert!(from(RailAdhesion::learned(&snapshot).unwrap()).distance_m > dry.distance_m);
    snapshot.parameters[0] = Parameter::AdhesionLowerBound as u32;
    assert_eq!(RailAdhesion::learned(&snapshot), None);
}

/// Returns a stop at 1 m/s² from 20 m/s on the level by a brake that comes as given.
fn coming(response: BrakeResponse) -> StoppingEstimate {
    Stop { response, ..Stop::level(20.0, 1e5, NO_RESISTANCE, &constant(1e5)) }
        .estimate(0.95)
        .unwrap()
}

#[test]
fn a_brake_that_builds_up_gives_the_closed_form() {
    const NONE: BrakeResponse = BrakeResponse::IMMEDIATE;
    // A ramp of T s loses a T/2 of speed, and v T - a T²/6 of distance are run in it.
    let ramp = coming(BrakeResponse { dead_time_s: 1.5, build_up_s: 4.0, ..NONE });
    let expected_m = 20.0 * 5.5 - 16.0 / 6.0 + 18.0 * 18.0 / 2.0;
    assert!((ramp.distance_m - expected_m).abs() < 1e-3, "{ramp:?}");
    assert!((ramp.time_s - (5.5 + 18.0)).abs() < 1e-6, "{ramp:?}");
    // A jerk limit of 0.25 m/s³ is that ramp, and the slower of both counts.
    let jerk = BrakeResponse { dead_time_s: 1.5, jerk_limit_mps3: 0.25, ..NONE };
    assert!((coming(jerk).distance_m - expected_m).abs() < 1e-3);
    let both = coming(BrakeResponse { build_up_s: 1.0, ..jerk });
    assert!((both.distance_m - expected_m).abs() < 1e-3);
    // A train on the level runs on alike, held by traction or not.
    let held = coming(BrakeResponse { traction_cut_off_s: 1.5, build_up_s: 4.0, ..NONE });
    assert!((held.distance_m - expected_m).abs() < 1e-3);
    // An uncertain response moves the bound by its quantile at the speed of the command.
    let unsure = coming(BrakeResponse { dead_time_s: 1.5, std_s: 0.5, ..NONE });
    assert!((unsure.distance_bound_m - unsure.distance_m - 1.6449 * 0.5 * 20.0).abs() < 1e-2);
}

#[test]
fn a_train_on_a_slope_gains_speed_before_the_brake_comes() {
    let slope = |response: BrakeResponse| {
        let effort = constant(1e5);
        let stop = Stop::level(20.0, 1e5, NO_RESISTANCE, &effort);
        Stop { gradient_permille: -20.0, response, ..stop }.estimate(0.9).unwrap().distance_m
    };
    let free = BrakeResponse { dead_time_s: 10.0, ..BrakeResponse::IMMEDIATE };
    let (gains, least) = (0.0200 * GRAVITY_MPS2, 1.0 - 0.0200 * GRAVITY_MPS2);
    let faster = 20.0 + 10.0 * gains;
    let expected_m = 10.0 * 0.5 * (20.0 + faster) + faster * faster / (2.0 * least);
    assert!((slope(free) - expected_m).abs() < 1e-6);
    let held = BrakeResponse { traction_cut_off_s: 10.0, ..BrakeResponse::IMMEDIATE };
    assert!((slope(held) - 200.0 - 400.0 / (2.0 * least)).abs() < 1e-6);
    // Uphill it stands before a slow brake has come.
    let effort = constant(1e5);
    let uphill = Stop { gradient_permille: 30.0, ..Stop::level(2.0, 1e5, NO_RESISTANCE, &effort) };
    let slow = BrakeResponse { build_up_s: 1e2, ..BrakeResponse::IMMEDIATE };
    let stands = Stop { response: slow, ..uphill }.estimate(0.9).unwrap();
    let by_the_slope_m = 4.0 / (2.0 * 0.030 * GRAVITY_MPS2);
    assert!(stands.distance_m < by_the_slope_m && stands.distance_m > 0.7 * by_the_slope_m);
}

/// A train whose brake differs from stop to stop.
struct Braked {
    from_mps: f64,
    mass_kg: f64,
    davis: [f64; 3],
    force_n: f64,
    response: BrakeResponse,
    /// Time in s by which the acting force follows the grown one.
    lag_s: f64,
    /// Relative standard deviation of the force.
    brake_std: f64,
    /// Whether the brake eases off by its jerk limit before the train stands.
    is_soft: bool,
}

impl Braked {
    /// Returns the distance in m by small steps of time, with a force and a dead time in standard deviations off.
    fn driven_m(&self, gradient_permille: f64, force_off: f64, time_off: f64) -> f64 {
        let BrakeResponse { dead_time_s, build_up_s, jerk_limit_mps3, std_s, .. } = self.response;
        let (full_mps2, step_s) = (self.force_n / self.mass_kg, 1e-3);
        let growth_mps3 = match build_up_s {
            0.0 => jerk_limit_mps3,
            build_up_s => full_mps2 / build_up_s,
        };
        let comes_s = dead_time_s - self.lag_s + time_off * std_s;
        let (mut time_s, mut speed_mps, mut distance_m) = (0.0, self.from_mps, 0.0);
        let (mut grown_mps2, mut acting_mps2) = (0.0_f64, 0.0);
        while speed_mps > 0.0 {
            let is_easing = self.is_soft && speed_mps < 0.5 * grown_mps2 * grown_mps2 / growth_mps3;
            if time_s >= comes_s {
                grown_mps2 = match is_easing {
                    true => (grown_mps2 - growth_mps3 * step_s).max(0.1),
                    false => (grown_mps2 + growth_mps3 * step_s).min(full_mps2),
                };
            }
            acting_mps2 += (grown_mps2 - acting_mps2) * (step_s / self.lag_s).min(1.0);
            let [a, b, c] = self.davis;
            let w0 = a + speed_mps * (b + speed_mps * c);
            let slope_mps2 = 1e-3 * GRAVITY_MPS2 * (w0 + gradient_permille);
            let brake_mps2 = acting_mps2 * (1.0 + self.brake_std * force_off);
            speed_mps -= step_s * (brake_mps2 + slope_mps2);
            distance_m += step_s * speed_mps.max(0.0);
            time_s += step_s;
        }
        distance_m
    }

    fn estimate(&self, gradient_permille: f64) -> StoppingEstimate {
        let effort = constant(self.force_n);
        let stop = Stop {
            gradient_permille,
            brake_scale: Uncertain::new(1.0, self.brake_std),
            response: self.response,
            ..Stop::level(self.from_mps, self.mass_kg, self.davis, &effort)
        };
        stop.estimate(0.95).unwrap()
    }
}

const TRAM: Braked = Braked {
    from_mps: 12.0,
    mass_kg: 42_000.0,
    davis: [5.0, 0.06, 0.0048],
    force_n: 48_000.0,
    response: BrakeResponse {
        dead_time_s: 0.6,
        jerk_limit_mps3: 0.8,
        std_s: 0.1,
        ..BrakeResponse::IMMEDIATE
    },
    lag_s: 0.25,
    brake_std: 0.04,
    is_soft: true,
};

const METRO: Braked = Braked {
    from_mps: 20.0,
    mass_kg: 230_000.0,
    davis: [2.1, 0.02, 0.0016],
    force_n: 220_000.0,
    response: BrakeResponse { dead_time_s: 0.9, jerk_limit_mps3: 0.6, ..TRAM.response },
    lag_s: 0.4,
    ..TRAM
};

const FREIGHT: Braked = Braked {
    from_mps: 22.0,
    mass_kg: 1_500_000.0,
    davis: [1.5, 0.015, 0.0009],
    force_n: 750_000.0,
    response: BrakeResponse {
        dead_time_s: 3.0,
        build_up_s: 20.0,
        std_s: 1.0,
        ..BrakeResponse::IMMEDIATE
    },
    lag_s: 0.5,
    brake_std: 0.05,
    is_soft: false,
};

#[test]
fn stops_of_a_tram_a_metro_and_a_freight_train_keep_their_bounds() {
    for (name, train, error_max_m) in
        [("tram", TRAM, 1.0), ("metro", METRO, 1.0), ("freight", FREIGHT, 5.0)]
    {
        // Force and dead time by a lattice of rank 1, each stop on a gradient of its own.
        let drawn = |index: i32, by: f64| normal_quantile((f64::from(index) * by + 0.5).fract());
        let stops: Vec<(f64, bool)> = (0..200)
            .map(|index| {
                let gradient = f64::from(index % 5 - 2) * 4.0;
                let force = drawn(index, 0.618_034).unwrap();
                let time = drawn(index, 0.754_878).unwrap();
                let found = train.estimate(gradient);
                let driven_m = train.driven_m(gradient, force, time);
                (driven_m - found.distance_m, driven_m <= found.distance_bound_m)
            })
            .collect();
        let held = stops.iter().filter(|stop| stop.1).count();
        let mean_m = stops.iter().map(|stop| stop.0).sum::<f64>() / stops.len() as f64;
        println!("{name}: {held} of {} within the bound, mean error {mean_m:+.2} m", stops.len());
        assert!(held >= 188, "{name}: {held}");
        assert!(mean_m.abs() < error_max_m, "{name}: {mean_m}");
    }
}
