//! Every resistance at one sample, put together from its terms.

use crate::train::Davis;

/// Lists the parts once, each with its value in the basic resistance alone.
macro_rules! parts {
    ($( $(#[doc = $doc:literal])* $part:ident = $basic:literal; )*) => {
        /// Resistances at one sample, without the Davis coefficients: each term writes its own part.
        ///
        /// ```text
        /// w(v) = factor (a + b v + c v²) + c (c_share v² + outside ((v + u)|v + u| - v²)) + dc v²
        ///        + curve + tunnel + place + bearing
        /// ```
        ///
        /// in N/kN, with the headwind u on the part of the train outside tunnels.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Resistance { $( $(#[doc = $doc])* pub $part: f64 ),* }

        impl Resistance {
            /// The basic resistance alone.
            pub const BASIC: Resistance = Resistance { $( $part: $basic ),* };
            /// Number of its parts.
            pub const PARTS: usize = [$( stringify!($part) ),*].len();

            /// Returns its parts, in the order of the fields.
            pub fn parts(&self) -> [f64; Self::PARTS] {
                [$( self.$part ),*]
            }

            /// The resistance of these [`parts`](Self::parts).
            pub fn of_parts([$( $part ),*]: [f64; Self::PARTS]) -> Self {
                Resistance { $( $part ),* }
            }
        }
    };
}

parts! {
    /// Of curves, in N/kN.
    curve_n_per_kn = 0.0;
    /// Of tunnels by their length, in N/kN.
    tunnel_n_per_kn = 0.0;
    /// Of places, in N/kN.
    place_n_per_kn = 0.0;
    /// Of cold bearings, in N/kN.
    bearing_n_per_kn = 0.0;
    /// Of everything in no library, in N/kN: at standstill, with a slope over the speed in N/kN per
    /// m/s that holds near the sample's.
    other_n_per_kn = 0.0;
    /// That slope.
    other_per_mps = 0.0;
    /// Factor on the basic resistance.
    factor = 1.0;
    /// Addition of tunnels to c, as share of it.
    c_share = 0.0;
    /// Addition of tunnels to c, in N/kN per (m/s)².
    dc = 0.0;
    /// Headwind in m/s.
    headwind_mps = 0.0;
    /// Share of the train that feels it.
    outside = 1.0;
}

impl Resistance {
    /// Returns the resistance at standstill, in N/kN.
    #[inline]
    fn constant_n_per_kn(&self) -> f64 {
        self.curve_n_per_kn
            + self.tunnel_n_per_kn
            + self.place_n_per_kn
            + self.bearing_n_per_kn
            + self.other_n_per_kn
    }

    /// Sign of the air resistance c (v + u) |v + u|.
    #[inline]
    fn air_sign(&self, speed_mps: f64) -> f64 {
        if speed_mps + self.headwind_mps < 0.0 { -1.0 } else { 1.0 }
    }

    /// Returns everything but the basic resistance of these coefficients, in N/kN.
    #[inline]
    pub fn extra_n_per_kn(&self, davis: Davis, speed_mps: f64) -> f64 {
        self.curve_n_per_kn
            + self.place_n_per_kn
            + self.bearing_n_per_kn
            + self.other_at_n_per_kn(speed_mps)
            + self.in_tunnels_n_per_kn(davis, speed_mps)
            + self.by_wind_n_per_kn(davis, speed_mps)
            + self.by_factor_n_per_kn(davis, speed_mps)
    }

    /// Returns the addition of tunnels, in N/kN: by their length, as share of c and in addition to it.
    #[inline]
    pub fn in_tunnels_n_per_kn(&self, davis: Davis, speed_mps: f64) -> f64 {
        self.tunnel_n_per_kn + (self.c_share * davis.c + self.dc) * speed_mps * speed_mps
    }

    /// Returns the addition of the wind to the air resistance, in N/kN.
    #[inline]
    pub fn by_wind_n_per_kn(&self, davis: Davis, speed_mps: f64) -> f64 {
        let square = speed_mps * speed_mps;
        let ahead_mps = speed_mps + self.headwind_mps;
        self.outside * davis.c * (ahead_mps * ahead_mps.abs() - square)
    }

    /// Returns the addition of the factor to the basic resistance, in N/kN.
    #[inline]
    pub fn by_factor_n_per_kn(&self, davis: Davis, speed_mps: f64) -> f64 {
        (self.factor - 1.0) * davis.w0_n_per_kn(speed_mps)
    }

    /// Returns everything in no library, in N/kN, for speeds near that at which it was taken.
    #[inline]
    pub fn other_at_n_per_kn(&self, speed_mps: f64) -> f64 {
        self.other_n_per_kn + self.other_per_mps * speed_mps
    }

    /// Returns all resistance in N/kN as p0 + p1 v + p2 v², for speeds near `near_mps`: the sign of the
    /// air resistance is taken there.
    #[inline]
    pub fn polynomial(&self, davis: Davis, near_mps: f64) -> [f64; 3] {
        let (factor, wind) = (self.factor, self.headwind_mps);
        let sign = self.air_sign(near_mps);
        let blown = self.outside * sign * davis.c;
        [
            self.constant_n_per_kn() + factor * davis.a + blown * wind * wind,
            factor * davis.b + self.other_per_mps + 2.0 * blown * wind,
            self.dc + davis.c * (factor + self.c_share + self.outside * (sign - 1.0)),
        ]
    }

    /// Returns the change of the resistance in N/kN by each unit of a, b and c.
    #[inline]
    pub fn davis_slopes(&self, speed_mps: f64) -> [f64; 3] {
        let square = speed_mps * speed_mps;
        let ahead_mps = speed_mps + self.headwind_mps;
        let blown = self.outside * (ahead_mps * ahead_mps.abs() - square);
        let factor = self.factor;
        [factor, factor * speed_mps, (factor + self.c_share) * square + blown]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAVIS: Davis = Davis { a: 1.7, b: 0.03, c: 0.0011 };

    fn everything() -> Resistance {
        Resistance {
            curve_n_per_kn: 0.7,
            tunnel_n_per_kn: 0.2,
            place_n_per_kn: 0.4,
            bearing_n_per_kn: 0.3,
            other_n_per_kn: -0.1,
            other_per_mps: 0.02,
            factor: 1.08,
            c_share: 0.4,
            dc: 2e-4,
            headwind_mps: -6.0,
            outside: 0.7,
        }
    }

    #[test]
    fn polynomial_slopes_and_sum_are_the_same_law() {
        let all = everything();
        for speed_mps in [0.0, 3.0, 9.0, 31.0] {
            let [p0, p1, p2] = all.polynomial(DAVIS, speed_mps);
            let by_polynomial = p0 + speed_mps * (p1 + speed_mps * p2);
            let w0 = DAVIS.w0_n_per_kn(speed_mps);
            let by_sum = w0 + all.extra_n_per_kn(DAVIS, speed_mps);
            assert!((by_polynomial - by_sum).abs() < 1e-12, "{speed_mps}");
            let [a, b, c] = all.davis_slopes(speed_mps);
            let constant = Resistance { dc: 0.0, ..all }.constant_n_per_kn();
            let sloped = |v: f64| v * (all.other_per_mps + all.dc * v);
            let by_slopes = a * DAVIS.a + b * DAVIS.b + c * DAVIS.c + constant + sloped(speed_mps);
            assert!((by_slopes - by_sum).abs() < 1e-12, "{speed_mps}");
        }
    }

    #[test]
    fn the_parts_make_the_same_resistance() {
        assert_eq!(Resistance::of_parts(everything().parts()), everything());
    }

    #[test]
    fn a_tail_wind_faster_than_the_train_pushes() {
        let behind = Resistance { headwind_mps: -8.0, ..Resistance::BASIC };
        let expected = DAVIS.c * (-(2.0 - 8.0_f64).powi(2) - 4.0);
        assert!((behind.extra_n_per_kn(DAVIS, 2.0) - expected).abs() < 1e-15);
    }
}
