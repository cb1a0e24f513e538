//! How much of a train is at a place.

/// How much of a train counts as inside an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    /// The part of the train's length inside.
    Share {
        /// The train's length in m.
        length_m: f64,
    },
    /// All of it while its centre is inside.
    Centre,
}

impl Inside {
    /// How far in m from its centre a train is inside a place.
    pub fn reach_m(self) -> f64 {
        match self {
            Inside::Share { length_m } => 0.5 * length_m.max(1.0),
            Inside::Centre => 0.0,
        }
    }

    /// The share of the train inside any of some disjoint intervals, 0 to 1, by the chainage of
    /// its centre; 0 where that is not known.
    #[inline]
    pub fn share(self, centre_m: Option<f64>, intervals_m: &[[f64; 2]]) -> f64 {
        let Some(centre_m) = centre_m else { return 0.0 };
        match self {
            Inside::Centre => {
                let inside = intervals_m.iter().any(|&[from, to]| (from..=to).contains(&centre_m));
                f64::from(u8::from(inside))
            }
            Inside::Share { length_m } => {
                let length_m = length_m.max(1.0);
                let (rear, front) = (centre_m - 0.5 * length_m, centre_m + 0.5 * length_m);
                let inside: f64 = intervals_m
                    .iter()
                    .map(|&[from, to]| (front.min(to) - rear.max(from)).max(0.0))
                    .sum();
                inside / length_m
            }
        }
    }
}
