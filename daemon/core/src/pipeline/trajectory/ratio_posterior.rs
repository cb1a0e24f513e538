//! What the likelihood leaves open about the disturbance ratio, and what that costs.
//!
//! A run of an hour tells the density of a disturbance within a factor of two or three. The
//! covariance for the likeliest one is too small as often as that one is, and a fit that finds
//! no disturbance at all is far too sure. The covariance is therefore averaged over the ratios by
//! their restricted likelihood, every decade being as likely beforehand.

use nalgebra::{Matrix3, Vector3};

/// Decades searched: from a disturbance that no run shows to one that binds the trajectory to
/// the measured speeds.
pub const EXPONENTS: std::ops::RangeInclusive<i32> = -7..=2;
/// Nodes between two decades around the likeliest one, the later decade among them.
const PER_DECADE: i32 = 4;
/// Every decade, and the nodes between the likeliest and its neighbours.
const NODES_MAX: usize = 16;

/// A ratio that has been tried.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tried {
    /// Decimal logarithm of the ratio.
    pub exponent: f64,
    /// Its restricted log-likelihood.
    pub log_likelihood: f64,
    /// The coefficients that belong to it.
    pub point: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
}

/// The ratios tried, in ascending order.
#[derive(Clone, Copy, Debug)]
pub struct RatioPosterior {
    nodes: [Tried; NODES_MAX],
    count: usize,
}

impl RatioPosterior {
    /// Before any trial.
    pub fn new() -> Self {
        RatioPosterior { nodes: [Tried::default(); NODES_MAX], count: 0 }
    }

    /// Adds a trial; beyond the capacity it is left out.
    pub fn add(&mut self, tried: Tried) {
        if self.count == NODES_MAX {
            return;
        }
        let place = self.nodes[..self.count].partition_point(|node| node.exponent < tried.exponent);
        self.nodes.copy_within(place..self.count, place + 1);
        self.nodes[place] = tried;
        self.count += 1;
    }

    fn nodes(&self) -> &[Tried] {
        &self.nodes[..self.count]
    }

    fn likeliest_index(&self) -> usize {
        let likelihood = |i: &usize| self.nodes[*i].log_likelihood;
        (0..self.count).max_by(|i, j| likelihood(i).total_cmp(&likelihood(j))).unwrap_or(0)
    }

    /// The likeliest of the ratios tried.
    pub fn likeliest(&self) -> &Tried {
        &self.nodes[self.likeliest_index()]
    }

    /// Exponents between the likeliest decade and its neighbours, downwards.
    pub fn between_neighbours(&self) -> impl Iterator<Item = f64> + use<> {
        let centre = self.likeliest().exponent;
        let (low, high) = (f64::from(*EXPONENTS.start()), f64::from(*EXPONENTS.end()));
        (1 - PER_DECADE..PER_DECADE)
            .rev()
            .filter(|step| *step != 0)
            .map(move |step| centre + f64::from(step) / f64::from(PER_DECADE))
            .filter(move |exponent| (low..=high).contains(exponent))
    }

    /// Exponent of the greatest likelihood, by a parabola through the likeliest ratio and its
    /// neighbours where they are as far apart.
    pub fn peak_exponent(&self) -> f64 {
        let (nodes, at) = (self.nodes(), self.likeliest_index());
        let centre = &nodes[at];
        let (Some(left), Some(right)) = (at.checked_sub(1).map(|i| &nodes[i]), nodes.get(at + 1))
        else {
            return centre.exponent;
        };
        let (below, above) = (centre.exponent - left.exponent, right.exponent - centre.exponent);
        let bend = left.log_likelihood - 2.0 * centre.log_likelihood + right.log_likelihood;
        if (below - above).abs() > 1e-9 || bend >= 0.0 {
            return centre.exponent;
        }
        centre.exponent + 0.5 * below * (left.log_likelihood - right.log_likelihood) / bend
    }

    /// Mean square error of given coefficients over all ratios, by the trapezoidal rule; `None`
    /// without a trial.
    pub fn covariance_about(&self, point: &Vector3<f64>) -> Option<Matrix3<f64>> {
        let nodes = self.nodes();
        let best = self.likeliest().log_likelihood;
        let (mut sum, mut total) = (Matrix3::zeros(), 0.0);
        for (i, node) in nodes.iter().enumerate() {
            let before = i.checked_sub(1).map_or(node.exponent, |i| nodes[i].exponent);
            let after = nodes.get(i + 1).map_or(node.exponent, |next| next.exponent);
            let weight = 0.5 * (after - before) * (node.log_likelihood - best).exp();
            let apart = node.point - point;
            sum += (node.covariance + apart * apart.transpose()) * weight;
            total += weight;
        }
        (total > 0.0).then(|| sum / total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trials of a likelihood that is normal over the exponent, with variances that follow it.
    fn posterior(centre: f64, width: f64) -> RatioPosterior {
        let tried = |exponent: f64| Tried {
            exponent,
            log_likelihood: -0.5 * ((exponent - centre) / width).powi(2),
            point: Vector3::new(exponent - centre, 0.0, 0.0),
            covariance: Matrix3::identity() * 10f64.powf(exponent - centre),
        };
        let mut posterior = RatioPosterior::new();
        EXPONENTS.for_each(|exponent| posterior.add(tried(f64::from(exponent))));
        for exponent in posterior.between_neighbours() {
            posterior.add(tried(exponent));
        }
        posterior
    }

    #[test]
    fn the_average_is_the_integral_over_a_normal_likelihood() {
        let (centre, width) = (-2.8, 0.3);
        let posterior = posterior(centre, width);
        assert!((posterior.peak_exponent() - centre).abs() < 1e-9);
        let covariance = posterior.covariance_about(&Vector3::zeros()).unwrap();
        // Mean of a log-normal variable.
        let expected = (0.5 * (width * 10f64.ln()).powi(2)).exp();
        // The coarse nodes of the tail overstate it somewhat.
        assert!((0.98..1.07).contains(&(covariance[(1, 1)] / expected)), "{covariance}");
        let spread = covariance[(0, 0)] - covariance[(1, 1)];
        assert!((0.95..1.15).contains(&(spread / (width * width))), "{spread}");
    }

    #[test]
    fn at_the_end_of_the_range_only_its_inner_side_is_tried() {
        let posterior = posterior(-9.0, 3.0);
        assert_eq!(posterior.peak_exponent(), -7.0);
        assert!(posterior.nodes().iter().all(|node| (-7.0..=2.0).contains(&node.exponent)));
        assert!(posterior.covariance_about(&Vector3::zeros()).unwrap()[(1, 1)] > 10.0);
    }
}
