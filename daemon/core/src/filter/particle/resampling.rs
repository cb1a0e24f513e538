//! Systematic resampling without a search.

use crate::filter::lanes;

/// Finds the ancestor of each place, the particle that it is drawn from: the ancestor of place p is the first particle
/// whose cumulated weight exceeds the level p + `offset`, where all weights together are scaled to the number of
/// particles. `offset` lies in 0 to 1; `ancestors` holds one place more than there are weights, the last without
/// meaning.
///
/// Each particle marks the place from which on later particles are drawn; the highest mark up to a place is its
/// ancestor. A search for the ancestor would take a branch that no processor can foresee.
///
/// # Real-time
///
/// Allocates nothing; work proportional to the weights.
pub(super) fn find_ancestors(weights: &[f64], offset: f64, ancestors: &mut [usize]) {
    let Some(last) = weights.len().checked_sub(1) else { return };
    ancestors.fill(0);
    // Weights sum to 1 but for rounding.
    let scale = weights.len() as f64 / lanes::sum(weights);
    let mut sum = 0.0;
    for (particle, weight) in weights[..last].iter().enumerate() {
        sum += weight;
        // The levels below `sum`: their number, rounded up.
        let level = sum * scale - offset;
        let whole = level as u32;
        let below = whole + u32::from(f64::from(whole) < level);
        ancestors[(below as usize).min(last + 1)] = particle + 1;
    }
    let mut highest = 0;
    for ancestor in ancestors {
        highest = highest.max(*ancestor);
        *ancestor = highest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::random::Random;

    /// Returns the same by a search.
    fn found(weights: &[f64], offset: f64) -> Vec<usize> {
        let spacing = weights.iter().sum::<f64>() / weights.len() as f64;
        let (mut ancestor, mut cumulated) = (0, weights[0]);
        (0..weights.len())
            .map(|index| {
                let level = (index as f64 + offset) * spacing;
                while ancestor + 1 < weights.len() && cumulated <= level {
                    ancestor += 1;
                    cumulated += weights[ancestor];
                }
                ancestor
            })
            .collect()
    }

    #[test]
    fn the_ancestors_are_those_that_a_search_finds() {
        let mut random = Random::new(5);
        for round in 0..500 {
            let count = 1 + round % 33;
            // Some weights vanish, some are nearly all.
            let weights: Vec<f64> =
                (0..count).map(|_| (random.uniform() - 0.2).max(0.0).powi(5) + 1e-300).collect();
            let offset = random.uniform();
            let mut ancestors = vec![0; count + 1];
            find_ancestors(&weights, offset, &mut ancestors);
            assert_eq!(ancestors[..count], found(&weights, offset), "round {round}");
        }
    }

    #[test]
    fn a_particle_of_all_the_weight_is_every_place_s_ancestor() {
        for heavy in 0..4 {
            let weights: Vec<f64> = (0..4).map(|i| f64::from(u8::from(i == heavy))).collect();
            let mut ancestors = [0; 5];
            find_ancestors(&weights, 0.5, &mut ancestors);
            assert_eq!(ancestors[..4], [heavy; 4]);
        }
    }
}
