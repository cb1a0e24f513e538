//! A site: the places along the line and the runs where an effect was found; its ends, estimated from the speeds.

use crate::explain::answer::Location;
use crate::explain::evidence::RunData;

/// Shortest interval in m.
const SHORTEST_M: f64 = 100.0;

/// Quantity in which the position of an end is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Chainage in m.
    Chainage,
    /// Time in s since the run's first sample.
    Time,
    /// A covariate, in its unit.
    Covariate,
}

/// Other values that an end could have.
#[derive(Clone, Debug, PartialEq)]
pub enum Reach {
    /// Anywhere between two values.
    Between(f64, f64),
    /// At one of some values, in ascending order.
    OneOf(Vec<f64>),
}

/// One end of an interval or window.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalEnd {
    /// Axis of the value.
    pub axis: Axis,
    /// The interval or window, by its index in the list.
    pub part: usize,
    /// True for the upper or later end.
    pub is_upper: bool,
    /// Where it was found.
    pub at: f64,
    /// Where else it could be.
    pub reach: Reach,
    /// A step that is surely small.
    pub fine: f64,
    /// The only run that it concerns, by file; `None` for all.
    pub run: Option<String>,
}

/// Disjoint intervals of chainage whose ends were estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Intervals {
    /// The intervals in m, by chainage.
    pub intervals_m: Vec<[f64; 2]>,
    /// The chainage in m over which the runs move.
    pub span_m: [f64; 2],
}

impl Intervals {
    /// All ends, lower before upper; each may move up to its neighbours.
    pub fn ends(&self) -> Vec<IntervalEnd> {
        let all = &self.intervals_m;
        let mut ends = Vec::new();
        for (part, &[from_m, to_m]) in all.iter().enumerate() {
            let below_m = if part == 0 { self.span_m[0] } else { all[part - 1][1] };
            let above_m = all.get(part + 1).map_or(self.span_m[1], |next| next[0]);
            let end = |is_upper: bool, at: f64, low_m: f64, high_m: f64| IntervalEnd {
                axis: Axis::Chainage,
                part,
                is_upper,
                at,
                reach: Reach::Between(low_m.min(at), high_m.max(at)),
                fine: 5.0,
                run: None,
            };
            ends.push(end(false, from_m, below_m, to_m - SHORTEST_M));
            ends.push(end(true, to_m, from_m + SHORTEST_M, above_m));
        }
        ends
    }

    /// The same with one end elsewhere; `None` when an interval would be gone or meet another.
    pub fn moved(&self, end: &IntervalEnd, at_m: f64) -> Option<Self> {
        let mut moved = self.clone();
        moved.intervals_m[end.part][usize::from(end.is_upper)] = at_m;
        let ascends = moved.intervals_m.iter().flatten().is_sorted();
        let [from_m, to_m] = moved.intervals_m[end.part];
        (ascends && from_m < to_m).then_some(moved)
    }
}

/// Where along the line and in which runs something was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Site {
    /// `None` for everywhere.
    pub sections: Option<Intervals>,
    /// Files of the runs; `None` for all that pass.
    pub runs: Option<Vec<String>>,
    /// Twice the logarithm of the number of structures this was chosen from.
    pub choice_cost: f64,
    /// Standard deviation of the factor by the error of the gradient map, which all passes share.
    pub map_error: f64,
}

impl Site {
    /// Its intervals in m; none where it is everywhere.
    pub fn intervals_m(&self) -> &[[f64; 2]] {
        self.sections.as_ref().map_or(&[], |sections| &sections.intervals_m)
    }

    /// Returns whether it may be in a run.
    pub fn is_in(&self, run: &RunData) -> bool {
        self.runs.as_ref().is_none_or(|runs| runs.contains(&run.file))
    }

    /// All ends of its intervals.
    pub fn ends(&self) -> Vec<IntervalEnd> {
        self.sections.as_ref().map_or_else(Vec::new, Intervals::ends)
    }

    /// The same with one end elsewhere; `None` where that makes no place.
    pub fn moved(&self, end: &IntervalEnd, at_m: f64) -> Option<Self> {
        let sections = Some(self.sections.as_ref()?.moved(end, at_m)?);
        Some(Site { sections, ..self.clone() })
    }

    /// As the answer says it.
    pub fn place(&self) -> Location {
        let intervals_m = self.sections.as_ref().map(|sections| sections.intervals_m.clone());
        Location { runs: self.runs.clone(), intervals_m, ..Location::default() }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Intervals {
        Intervals { intervals_m: vec![[1000.0, 2000.0], [3000.0, 3500.0]], span_m: [0.0, 5000.0] }
    }

    #[test]
    fn an_end_reaches_from_its_own_interval_to_the_neighbour() {
        let ends = two().ends();
        let reaches: Vec<&Reach> = ends.iter().map(|end| &end.reach).collect();
        assert_eq!(
            reaches,
            [
                &Reach::Between(0.0, 1900.0),
                &Reach::Between(1100.0, 3000.0),
                &Reach::Between(2000.0, 3400.0),
                &Reach::Between(3100.0, 5000.0)
            ]
        );
    }

    #[test]
    fn an_end_moves_by_itself_and_never_into_a_neighbour() {
        let sections = two();
        let ends = sections.ends();
        let moved = sections.moved(&ends[1], 2500.0).unwrap();
        assert_eq!(moved.intervals_m, [[1000.0, 2500.0], [3000.0, 3500.0]]);
        assert_eq!(sections.moved(&ends[1], 3200.0), None);
        assert_eq!(sections.moved(&ends[0], 2000.0), None);
    }
}
