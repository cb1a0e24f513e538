//! Sums and powers over slices that the compiler turns into vector instructions.

/// Returns the sum of products; summed in four lanes, so that the additions do not wait for each other.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_lanes, b_lanes) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a_lanes.remainder().iter().zip(b_lanes.remainder()).map(|(x, y)| x * y).sum();
    let mut sums = [0.0; 4];
    for (x, y) in a_lanes.zip(b_lanes) {
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    // In an order that keeps neighbours in one vector.
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Returns the sum of a slice, in four lanes.
pub fn sum(a: &[f64]) -> f64 {
    let lanes = a.chunks_exact(4);
    let rest: f64 = lanes.remainder().iter().sum();
    let mut sums = [0.0; 4];
    for x in lanes {
        for lane in 0..4 {
            sums[lane] += x[lane];
        }
    }
    // In an order that keeps neighbours in one vector.
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Binary logarithm of the smallest density that is distinguished from 0.
const SMALLEST: f64 = -300.0;

/// 2^x for x <= 0 with a relative error below 4e-6; 0 below -300 and for NaN.
///
/// Densities of particles need no more digits, and without a call or a branch the loop over
/// particles is vectorised. The cut keeps products of a few densities away from the subnormal
/// numbers, which are slow.
#[inline]
pub fn exp2_nonpositive(x: f64) -> f64 {
    // Adding 1.5 * 2^52 rounds to an integer, which then stands in the lowest bits.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    // (ln 2)^k / k! from k = 5 down to 0.
    const SERIES: [f64; 6] = [
        0.0013333558146428441,
        0.009618129107628477,
        0.055504108664821576,
        0.2402265069591007,
        std::f64::consts::LN_2,
        1.0,
    ];
    let rounded = x + ROUNDER;
    let rest = x - (rounded - ROUNDER);
    let mut series = SERIES[0];
    for term in &SERIES[1..] {
        series = series * rest + term;
    }
    let scaled = f64::from_bits(series.to_bits().wrapping_add(rounded.to_bits() << 52));
    if x > SMALLEST { scaled } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_sum_what_a_plain_loop_sums() {
        for count in 0..13 {
            let a: Vec<f64> = (0..count).map(|i| f64::from(i) - 3.5).collect();
            let b: Vec<f64> = a.iter().map(|x| x * x + 1.0).collect();
            let plain: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
            assert!((dot(&a, &b) - plain).abs() < 1e-10);
            assert!((sum(&a) - a.iter().sum::<f64>()).abs() < 1e-12);
        }
    }

    #[test]
    fn the_power_of_two_agrees_with_the_exact_one() {
        for i in 0..29_999 {
            let x = -0.01 * f64::from(i);
            let (exact, found) = (x.exp2(), exp2_nonpositive(x));
            assert!((found / exact - 1.0).abs() < 4e-6, "{x}: {found} instead of {exact}");
        }
        assert_eq!(exp2_nonpositive(0.0), 1.0);
        for x in [-301.0, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(exp2_nonpositive(x), 0.0);
        }
    }
}
