//! The wheels' diameter against the declared one: the distance by speed over the distance by position.
//!
//! A position derived from the same wheel shows nothing; fixes at balises, or GNSS, do. The difference between chainage
//! and integrated speed is `offset - error * distance`, so that a straight line over points some distance apart gives
//! the error of the speed's scale. Each unbroken row of points has an offset of its own.

use dynocar_model::force::ResolvedSample;

/// Distance in m between points: fixes lie so far apart.
const APART_M: f64 = 500.0;
/// Standard deviation in m of a point: the error of a fix, and the drift of the odometer until the next fix.
const POINT_STD_M: f64 = 5.0;
/// A position that is wrong by more than this in m is refused, unless the next ones agree with it; a wheel that is 5 %
/// off drifts less over two kilometres between balises.
const JUMP_M: f64 = 120.0;
/// Samples in a row that say the position did jump.
const JUMP_SAMPLES: u32 = 10;
/// Standard deviation of the scale's error before the data.
const PRIOR_STD: f64 = 0.02;

/// A line through the points of a row, as sums over them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct DesignRow {
    count: f64,
    distance: f64,
    distance_square: f64,
    offset: f64,
    product: f64,
    last_offset_m: f64,
}

/// The row of points that is growing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Going {
    segment: u32,
    direction: f64,
    /// Distance by speed in m since the row began.
    travelled_m: f64,
    /// Time in ns and speed in m/s of the newest sample.
    last: (i64, f64),
    /// Chainage less distance where the row began.
    origin_m: f64,
    /// Mean offset since the last point, over a number of samples.
    mean_m: f64,
    samples: f64,
    strangers: u32,
    next_m: f64,
    row: DesignRow,
}

/// Watches the scale of the speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelScale {
    going: Option<Going>,
    /// Information on the scale's error, and its product with it, of all rows.
    information: f64,
    product: f64,
}

impl WheelScale {
    /// Takes in a sample whose speed is believed.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, sample: &ResolvedSample) {
        let Some(position_m) = sample.position_m else { return };
        let going = self
            .going
            .as_mut()
            .filter(|going| going.segment == sample.segment && going.direction == sample.direction);
        let Some(going) = going else { return self.restart(sample, position_m) };
        let (last_ns, last_mps) = going.last;
        let step_s = sample.time_ns.saturating_sub(last_ns) as f64 * 1e-9;
        going.travelled_m += 0.5 * (last_mps + sample.speed_mps) * step_s;
        going.last = (sample.time_ns, sample.speed_mps);
        let offset_m = going.direction * position_m - going.origin_m - going.travelled_m;
        let expected_m = if going.samples > 0.0 { going.mean_m } else { going.row.last_offset_m };
        if (offset_m - expected_m).abs() > JUMP_M {
            going.strangers += 1;
            if going.strangers > JUMP_SAMPLES {
                self.restart(sample, position_m);
            }
            return;
        }
        going.strangers = 0;
        going.samples += 1.0;
        going.mean_m += (offset_m - going.mean_m) / going.samples;
        if going.travelled_m >= going.next_m {
            going.row.push(going.travelled_m - 0.5 * APART_M, going.mean_m);
            going.next_m += APART_M;
            (going.mean_m, going.samples) = (0.0, 0.0);
        }
    }

    fn restart(&mut self, sample: &ResolvedSample, position_m: f64) {
        if let Some(going) = self.going {
            let (information, product) = going.row.gathered();
            self.information += information;
            self.product += product;
        }
        self.going = Some(Going {
            segment: sample.segment,
            direction: sample.direction,
            travelled_m: 0.0,
            last: (sample.time_ns, sample.speed_mps),
            origin_m: sample.direction * position_m,
            mean_m: 0.0,
            samples: 0.0,
            strangers: 0,
            next_m: APART_M,
            row: DesignRow::default(),
        });
    }

    /// Forgets a share of the evidence of rows that ended.
    pub fn forget(&mut self, kept: f64) {
        self.information *= kept;
        self.product *= kept;
    }

    /// Returns the speed's scale less 1, and twice the log-likelihood ratio of a scale beyond the `usual` error against
    /// a usual one, less the price of the freedom.
    pub fn evidence(&self, usual: f64) -> (f64, f64) {
        let (information, product) = self.going.map_or((0.0, 0.0), |going| going.row.gathered());
        let prior = 1.0 / (PRIOR_STD * PRIOR_STD);
        let precision = self.information + information + prior;
        let error = (self.product + product) / precision;
        let beyond = (error.abs() - usual).max(0.0);
        (error, beyond * beyond * precision - (precision / prior).ln())
    }
}

impl DesignRow {
    fn push(&mut self, travelled_m: f64, offset_m: f64) {
        self.count += 1.0;
        self.distance += travelled_m;
        self.distance_square += travelled_m * travelled_m;
        self.offset += offset_m;
        self.product += travelled_m * offset_m;
        self.last_offset_m = offset_m;
    }

    /// Returns the information on the error of the scale, and its product with it.
    fn gathered(&self) -> (f64, f64) {
        if self.count < 3.0 {
            return (0.0, 0.0);
        }
        let variance = POINT_STD_M * POINT_STD_M;
        let spread = self.distance_square - self.distance * self.distance / self.count;
        let slope_side = self.product - self.distance * self.offset / self.count;
        // The measured distance is too long by the error: the offset falls as it grows.
        (spread / variance, -slope_side / variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::terms::wheel::LEAST;

    /// Two runs of 10 km to and fro at 20 m/s whose wheels measure `scale` times the true speed,
    /// with a position that a balise corrects every 1000 m.
    fn driven(scale: f64, has_balises: bool, spoil: impl Fn(usize) -> f64) -> WheelScale {
        let mut wheels = WheelScale::default();
        for (run, direction) in [1.0, -1.0].into_iter().enumerate() {
            for k in 0..2500 {
                let true_travelled_m = 20.0 * 0.2 * k as f64;
                let since_fix_m =
                    if has_balises { true_travelled_m % 1000.0 } else { true_travelled_m };
                let shown_m = true_travelled_m - since_fix_m + scale * since_fix_m;
                wheels.push(&ResolvedSample {
                    segment: run as u32,
                    time_ns: 200_000_000 * k as i64,
                    direction,
                    position_m: Some(5000.0 + direction * shown_m + spoil(k)),
                    speed_mps: scale * 20.0,
                    ..ResolvedSample::coasting()
                });
            }
        }
        wheels
    }

    #[test]
    fn fixes_show_the_scale_of_the_speed_in_both_directions() {
        for scale in [0.98, 1.012, 1.02] {
            let (error, evidence) = driven(scale, true, |_| 0.0).evidence(LEAST);
            assert!((error + 1.0 - scale).abs() < 1e-3, "{scale}: {error}");
            assert!(evidence > 30.0, "{scale}: {evidence}");
        }
    }

    #[test]
    fn right_wheels_a_wheel_that_counts_its_own_way_and_wild_positions_raise_nothing() {
        let wild = |k: usize| if k % 50 == 7 { 900.0 } else { 0.0 };
        let moved = |k: usize| if k > 1000 { 700.0 } else { 0.0 };
        for (case, wheels) in [
            ("right", driven(1.0, true, |_| 0.0)),
            ("its own way", driven(1.02, false, |_| 0.0)),
            ("wild", driven(1.0, true, wild)),
            ("moved for good", driven(1.0, true, moved)),
        ] {
            let (error, evidence) = wheels.evidence(LEAST);
            assert!(error.abs() < 2e-3 && evidence < 0.0, "{case}: {error}, {evidence}");
        }
    }
}
