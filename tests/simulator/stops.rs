//! The estimated law of simulated stops, compared with the true one, and the next stop, compared with its bound.

use dynocar_analysis::stops::{DecelerationCurve, DecelerationLaw, Gradient};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Returns the true deceleration, which grows as the speed falls, as with cast-iron blocks.
pub fn true_mps2(speed_mps: f64) -> f64 {
    0.3 + 0.7 / (1.0 + speed_mps / 12.0)
}

pub fn normal(random: &mut StdRng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Returns the samples of a stop with `factor` times the true deceleration after a dead time of 1 s, at 5 Hz, with
/// noise and in steps of 0.2 m/s; and its true distance.
pub fn stop(factor: f64, from_mps: f64, random: &mut StdRng) -> (Vec<TrainSample>, f64) {
    let (mut samples, mut speed_mps, mut distance_m) = (Vec::new(), from_mps, 0.0);
    let step_s = 0.01;
    for k in 0.. {
        if k % 20 == 0 {
            let measured = speed_mps + 0.03 * normal(random);
            let mut sample = TrainSample::empty(TrainId(1));
            sample.time_ns = k * 10_000_000;
            sample.set(SampleField::Speed, (0.2 * (measured / 0.2).round()).max(0.0));
            samples.push(sample);
        }
        if speed_mps <= 0.0 {
            return (samples, distance_m);
        }
        let acts = k as f64 * step_s >= 1.0;
        let deceleration = if acts { factor * true_mps2(speed_mps) } else { 0.0 };
        distance_m += step_s * speed_mps;
        speed_mps -= step_s * deceleration;
    }
    unreachable!()
}

#[test]
fn the_law_of_one_stop_holds_the_true_one_and_the_next_stop_keeps_its_bound() {
    let (mut inside, mut looks, mut kept, mut error) = (0, 0, 0, 0.0);
    let seeds = 100;
    for seed in 0..seeds {
        let mut random = StdRng::seed_from_u64(seed);
        let factors = [1.0 + 0.03 * normal(&mut random), 1.0 + 0.03 * normal(&mut random)];
        let (samples, _) = stop(factors[0], 30.0, &mut random);
        let law = DecelerationLaw::new(&[DecelerationCurve::from_samples(&samples).unwrap()], 0.03)
            .unwrap();
        for point in law.points.iter().filter(|it| (2.0..27.0).contains(&it.speed_mps)) {
            let truth = factors[0] * true_mps2(point.speed_mps);
            let off = (point.deceleration_mps2 - truth).abs();
            error += (off / truth).powi(2);
            looks += 1;
            inside += i32::from(off <= 1.96 * point.std_mps2);
        }
        let (_, distance_m) = stop(factors[1], 30.0, &mut random);
        let next = law.stopping_distance(30.0, &Gradient::default()).unwrap();
        kept += i32::from(distance_m <= next.distance_bound_m);
    }
    let rms = (error / f64::from(looks)).sqrt();
    let share = f64::from(inside) / f64::from(looks);
    println!("deceleration off by {rms:.4} rms, {share:.3} inside, {kept} bounds kept");
    assert!(rms < 0.03, "{rms}");
    assert!((0.9..=0.995).contains(&share), "{share}");
    assert!(kept >= 93, "{kept} of {seeds}");
}

#[test]
fn many_stops_show_their_own_repeatability_and_slower_ones_say_nothing_of_faster_speeds() {
    let mut random = StdRng::seed_from_u64(7);
    let curves: Vec<DecelerationCurve> = (0..30)
        .map(|k| {
            let factor = 1.0 + 0.08 * normal(&mut random);
            let from_mps = if k % 2 == 0 { 28.0 } else { 14.0 };
            DecelerationCurve::from_samples(&stop(factor, from_mps, &mut random).0).unwrap()
        })
        .collect();
    let law = DecelerationLaw::new(&curves, 0.03).unwrap();
    assert!((0.05..0.11).contains(&law.repeatability), "{}", law.repeatability);
    assert!((law.response.lost_s() - 1.0).abs() < 0.3, "{:?}", law.response);
    assert_eq!((law.points[4].stops, law.points[19].stops), (30, 15));
    assert!(law.stopping_distance(40.0, &Gradient::default()).is_none());
    let (_, distance_m) = stop(1.0, 28.0, &mut random);
    let next = law.stopping_distance(28.0, &Gradient::default()).unwrap();
    assert!((next.distance_m / distance_m - 1.0).abs() < 0.05, "{next:?} and {distance_m}");
}
