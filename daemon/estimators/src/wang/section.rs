//! Which of the three resistances a piece of motion informs on.

use super::motion::Motion;

/// A share at which the whole train counts as inside.
const WHOLE: f64 = 0.999;

/// The learning sets of Wang 2022, section 3.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Neither curve nor tunnel: z1.
    Basic = 0,
    /// In a curve: z2.
    Curve = 1,
    /// In a tunnel: z3.
    Tunnel = 2,
}

impl Section {
    /// Every section, in the order of its number.
    pub const ALL: [Section; 3] = [Section::Basic, Section::Curve, Section::Tunnel];

    /// The set of a step between two samples.
    ///
    /// As in Algorithm 1, a step in a curve inside a tunnel belongs to the curve set. A train has
    /// a length, which the paper's mass point lacks: steps while a part of it is inside belong to
    /// no set.
    pub fn of(from: &Motion, to: &Motion) -> Option<Section> {
        let is_curved = from.curvature_per_m > 0.0 || to.curvature_per_m > 0.0;
        if is_curved {
            let change = (to.curvature_per_m - from.curvature_per_m).abs();
            let is_steady = change <= (1.0 - WHOLE) * to.curvature_per_m;
            return is_steady.then_some(Section::Curve);
        }
        let (low, high) = if from.tunnel_share < to.tunnel_share {
            (from.tunnel_share, to.tunnel_share)
        } else {
            (to.tunnel_share, from.tunnel_share)
        };
        if high <= 0.0 {
            Some(Section::Basic)
        } else if low >= WHOLE {
            Some(Section::Tunnel)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(curvature_per_m: f64, tunnel_share: f64) -> Motion {
        Motion {
            time_ns: 0,
            segment: 1,
            speed_mps: 10.0,
            force_n: 0.0,
            declared_kg: 1e5,
            known_n_per_kn: 0.0,
            gradient_std_permille: 0.0,
            curvature_per_m,
            tunnel_share,
        }
    }

    fn steady(curvature_per_m: f64, tunnel_share: f64) -> Option<Section> {
        Section::of(&at(curvature_per_m, tunnel_share), &at(curvature_per_m, tunnel_share))
    }

    #[test]
    fn a_curve_inside_a_tunnel_belongs_to_the_curve_set() {
        assert_eq!(steady(0.0, 0.0), Some(Section::Basic));
        assert_eq!(steady(0.002, 0.0), Some(Section::Curve));
        assert_eq!(steady(0.002, 1.0), Some(Section::Curve));
        assert_eq!(steady(0.0, 1.0), Some(Section::Tunnel));
    }

    #[test]
    fn a_train_on_its_way_in_belongs_to_no_set() {
        assert_eq!(Section::of(&at(0.0, 0.0), &at(0.0005, 0.0)), None);
        assert_eq!(Section::of(&at(0.0005, 0.0), &at(0.0009, 0.0)), None);
        assert_eq!(Section::of(&at(0.0, 0.4), &at(0.0, 0.6)), None);
        assert_eq!(steady(0.0, 0.4), None);
    }
}
