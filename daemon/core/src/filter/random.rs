//! A small seeded generator, so that every estimate can be repeated bit for bit.

/// xoshiro256++ (Blackman and Vigna 2021), seeded by SplitMix64.
#[derive(Clone, Debug, PartialEq)]
pub struct Random {
    state: [u64; 4],
    ziggurat: Ziggurat,
}

/// Returns the next number of the generator SplitMix64, whose state is a counter.
pub fn split_mix(counter: &mut u64) -> u64 {
    *counter = counter.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut mixed = *counter;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

impl Random {
    /// Returns a generator for a seed; equal seeds give equal sequences.
    pub fn new(seed: u64) -> Self {
        let mut counter = seed;
        let state = std::array::from_fn(|_| split_mix(&mut counter));
        Random { state, ziggurat: Ziggurat::new() }
    }

    #[inline]
    fn next(&mut self) -> u64 {
        let [a, b, c, d] = &mut self.state;
        let result = a.wrapping_add(*d).rotate_left(23).wrapping_add(*a);
        let shifted = *b << 17;
        *c ^= *a;
        *d ^= *b;
        *b ^= *c;
        *a ^= *d;
        *c ^= shifted;
        *d = d.rotate_left(45);
        result
    }

    /// Uniform in 0 <= x < 1.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a standard normal number, by the ziggurat of Marsaglia and Tsang in Doornik's form (2005).
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let (layer, place) = self.layer_and_place();
        if place.abs() < self.ziggurat.inner[layer] {
            place * self.ziggurat.edges[layer]
        } else {
            self.normal_at_edge(layer, place)
        }
    }

    /// Returns a layer and where in it, from -1 to 1; from different bits of one number.
    #[inline]
    fn layer_and_place(&mut self) -> (usize, f64) {
        let bits = self.next();
        ((bits & 0x7f) as usize, (bits >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0)
    }

    /// Returns the normal number of a place that does not lie wholly inside its layer: about one in 80.
    #[cold]
    #[inline(never)]
    fn normal_at_edge(&mut self, mut layer: usize, mut place: f64) -> f64 {
        loop {
            let x = place * self.ziggurat.edges[layer];
            if place.abs() < self.ziggurat.inner[layer] {
                return x;
            }
            if layer == 0 {
                return self.tail(place < 0.0);
            }
            let (low, high) = (self.ziggurat.edges[layer], self.ziggurat.edges[layer + 1]);
            let from_low = (-0.5 * (low * low - x * x)).exp();
            let from_high = (-0.5 * (high * high - x * x)).exp();
            if from_high + self.uniform() * (from_low - from_high) < 1.0 {
                return x;
            }
            (layer, place) = self.layer_and_place();
        }
    }

    /// Returns a number beyond the last edge.
    fn tail(&mut self, is_negative: bool) -> f64 {
        loop {
            // 1 - u keeps the logarithm finite.
            let x = (1.0 - self.uniform()).ln() / TAIL_START;
            let y = (1.0 - self.uniform()).ln();
            if -2.0 * y >= x * x {
                return if is_negative { x - TAIL_START } else { TAIL_START - x };
            }
        }
    }
}

const LAYERS: usize = 128;
/// Where the tail starts, for 128 layers.
const TAIL_START: f64 = 3.442_619_855_899;
/// Area of each layer.
const LAYER_AREA: f64 = 9.912_563_035_262_17e-3;

/// Edges of the layers under the normal density, and the share of each that lies wholly inside.
#[derive(Clone, Debug, PartialEq)]
struct Ziggurat {
    edges: [f64; LAYERS + 1],
    inner: [f64; LAYERS],
}

impl Ziggurat {
    fn new() -> Self {
        let mut edges = [0.0; LAYERS + 1];
        let mut density = (-0.5 * TAIL_START * TAIL_START).exp();
        edges[0] = LAYER_AREA / density;
        edges[1] = TAIL_START;
        for layer in 2..LAYERS {
            edges[layer] = (-2.0 * (LAYER_AREA / edges[layer - 1] + density).ln()).sqrt();
            density = (-0.5 * edges[layer] * edges[layer]).exp();
        }
        let inner = std::array::from_fn(|layer| edges[layer + 1] / edges[layer]);
        Ziggurat { edges, inner }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_seeds_give_equal_sequences_and_others_do_not() {
        let draw = |seed| {
            let mut random = Random::new(seed);
            [random.uniform(), random.uniform(), random.normal()]
        };
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
    }

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_distribution() {
        let mut random = Random::new(1);
        let count = 100_000;
        let (mut sums, mut product) = ([0.0; 4], 0.0);
        for _ in 0..count {
            let (x, y) = (random.normal(), random.normal());
            for (power, sum) in sums.iter_mut().enumerate() {
                *sum += x.powi(power as i32 + 1);
            }
            product += x * y;
        }
        let moments = sums.map(|sum| sum / f64::from(count));
        // Five standard errors of each moment's estimate.
        let tolerances = [1.0_f64, 2.0, 15.0, 96.0].map(|v| 5.0 * (v / f64::from(count)).sqrt());
        for (k, expected) in [0.0, 1.0, 0.0, 3.0].into_iter().enumerate() {
            assert!((moments[k] - expected).abs() < tolerances[k], "moment {}", k + 1);
        }
        assert!((product / f64::from(count)).abs() < tolerances[0]);
    }

    #[test]
    fn normal_numbers_fill_body_and_tail_as_they_should() {
        let mut random = Random::new(2);
        let count = 400_000;
        // Two-sided tail probabilities; the last lies wholly beyond the ziggurat's last edge.
        let cases = [(0.5, 0.617_075), (1.5, 0.133_614), (3.0, 2.699_8e-3), (3.5, 4.652_6e-4)];
        let mut beyond = [0u32; 4];
        for _ in 0..count {
            let x = random.normal().abs();
            for (number, (edge, _)) in beyond.iter_mut().zip(cases) {
                *number += u32::from(x > edge);
            }
        }
        for (number, (edge, probability)) in beyond.iter().zip(cases) {
            let share = f64::from(*number) / f64::from(count);
            let std = (probability * (1.0 - probability) / f64::from(count)).sqrt();
            assert!((share - probability).abs() < 5.0 * std, "beyond {edge}: {share}");
        }
    }
}
