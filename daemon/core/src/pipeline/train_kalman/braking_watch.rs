//! Whether the brake acts as reported: on a rail that carries less than the brake asks for it does not.

/// Brake force in N/kN from which a braking begins, and below which it has ended.
const BEGINS_N_PER_KN: f64 = 5.0;
const ENDS_N_PER_KN: f64 = 1.0;
/// Normalised innovations count no further than this.
const COUNTS_MAX: f64 = 4.0;
/// Their sum over the root of their number may not lie beyond this: white ones do not, and those of a brake
/// some 10 % off neither.
const LIMIT: f64 = 7.0;
/// Innovations before they are judged.
const JUDGED_MIN: f64 = 5.0;

/// Follows a braking and what its innovations add up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BrakingWatch {
    is_braking: bool,
    is_refused: bool,
    sum: f64,
    count: f64,
}

impl BrakingWatch {
    /// Takes in a brake force in N/kN; true when a braking begins with it.
    pub fn begins(&mut self, brake_n_per_kn: f64) -> bool {
        self.end_below(brake_n_per_kn);
        let begins = !self.is_braking && brake_n_per_kn >= BEGINS_N_PER_KN;
        self.is_braking |= begins;
        begins
    }

    /// Takes in a brake force in N/kN; true from where the braking was refused to its end.
    pub fn is_still_refused(&mut self, brake_n_per_kn: f64) -> bool {
        self.end_below(brake_n_per_kn);
        self.is_refused
    }

    fn end_below(&mut self, brake_n_per_kn: f64) {
        if brake_n_per_kn < ENDS_N_PER_KN {
            *self = BrakingWatch::default();
        }
    }

    /// Takes in a normalised innovation; true when the braking is refused by it.
    pub fn refuses(&mut self, normalised: f64) -> bool {
        if !self.is_braking {
            return false;
        }
        self.sum += normalised.clamp(-COUNTS_MAX, COUNTS_MAX);
        self.count += 1.0;
        self.is_refused = self.count >= JUDGED_MIN && self.sum.abs() > LIMIT * self.count.sqrt();
        self.is_refused
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Innovations of a braking until it is refused.
    fn refused_after(mean: f64) -> Option<u32> {
        let mut watch = BrakingWatch::default();
        assert!(!watch.begins(2.0) && watch.begins(40.0) && !watch.begins(60.0));
        (1..400).find(|k| watch.refuses(mean + if k % 2 == 0 { 1.0 } else { -1.0 }))
    }

    #[test]
    fn a_braking_is_refused_where_innovations_lie_to_one_side_and_until_it_ends() {
        assert_eq!(refused_after(0.0), None);
        assert_eq!(refused_after(0.3), None);
        assert!(refused_after(2.0).unwrap() < 20);
        let mut watch = BrakingWatch::default();
        assert!(!watch.refuses(10.0), "no braking");
        watch.begins(40.0);
        assert!((0..20).any(|_| watch.refuses(3.0)) && watch.is_still_refused(3.0));
        assert!(!watch.is_still_refused(0.5) && watch.begins(40.0));
    }
}
