//! Where a mass holds: it changes only while the train stands.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::track::MassSection;

use crate::explain::evidence::RunData;
use crate::explain::places::span_m;
use crate::explain::scan::Scan;

/// Standing for less than this in s lets nobody on or off.
pub const STOP_MIN_S: f64 = 8.0;
/// Stops within this distance in m are one station.
pub const STATION_M: f64 = 350.0;

/// Where one factor holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// Without a direction: the same in both.
    Section {
        from_m: f64,
        to_m: f64,
        direction: Option<f64>,
    },
    Window {
        run: String,
        from_s: f64,
        to_s: f64,
        offset_s: f64,
    },
}

impl Part {
    /// True when it may hold in a run.
    pub fn is_in(&self, run: &RunData) -> bool {
        match self {
            Part::Section { .. } => true,
            Part::Window { run: file, .. } => *file == run.file,
        }
    }

    /// True when sample number `index` of a run in which it may hold lies in it.
    #[inline]
    pub fn holds(&self, run: &RunData, index: usize) -> bool {
        match self {
            Part::Section { from_m, to_m, direction } => {
                let (from_m, to_m, towards) = (*from_m, *to_m, run.directions[index]);
                let direction = direction.unwrap_or(towards);
                let section = MassSection { from_m, to_m, direction, mass_factor: 1.0 };
                let at_m = run.covariate(Covariate::Chainage)[index];
                !at_m.is_nan() && section.holds(at_m, towards)
            }
            Part::Window { from_s, to_s, .. } => {
                (*from_s..=*to_s).contains(&run.recording.time_s()[index])
            }
        }
    }

    /// Both ends: chainages in m or times in s since the run's first sample.
    pub fn ends(&self) -> [f64; 2] {
        match self {
            Part::Section { from_m, to_m, .. } => [*from_m, *to_m],
            Part::Window { from_s, to_s, .. } => [*from_s, *to_s],
        }
    }

    /// The same with one end elsewhere; `None` when nothing would be left.
    pub fn with_end(&self, is_upper: bool, at: f64) -> Option<Part> {
        let mut moved = self.clone();
        let (from, to) = match &mut moved {
            Part::Section { from_m, to_m, .. } => (from_m, to_m),
            Part::Window { from_s, to_s, .. } => (from_s, to_s),
        };
        *(if is_upper { &mut *to } else { &mut *from }) = at;
        (*from < *to).then_some(moved)
    }

    /// Ends of those of some parts that lie along the same axis, in ascending order.
    pub fn edges<'p>(&self, parts: impl Iterator<Item = &'p Part>) -> Vec<f64> {
        let along = |other: &&Part| match (self, *other) {
            (Part::Section { direction, .. }, Part::Section { direction: towards, .. }) => {
                direction == towards
            }
            (Part::Window { run, .. }, Part::Window { run: file, .. }) => run == file,
            _ => false,
        };
        let mut edges: Vec<f64> = parts.filter(along).flat_map(Part::ends).collect();
        edges.sort_unstable_by(f64::total_cmp);
        edges.dedup();
        edges
    }

    /// True when two parts share no sample.
    pub fn is_apart(&self, other: &Part) -> bool {
        match (self, other) {
            (
                Part::Section { from_m, to_m, direction },
                Part::Section { from_m: from, to_m: to, direction: towards },
            ) => {
                let opposite = direction.zip(*towards).is_some_and(|(one, other)| one != other);
                opposite || to_m <= from || to <= from_m
            }
            (
                Part::Window { run, from_s, to_s, .. },
                Part::Window { run: file, from_s: from, to_s: to, .. },
            ) => run != file || to_s <= from || to <= from_s,
            _ => false,
        }
    }
}

/// Standing times of a run: (from, to) in s and the place in m.
pub fn stops(run: &RunData) -> Vec<(f64, f64, Option<f64>)> {
    let (samples, time_s) = (run.samples(), run.recording.time_s());
    let mut stops = Vec::new();
    let mut since: Option<usize> = None;
    for i in 0..=samples.len() {
        let stands = samples.get(i).is_some_and(|sample| sample.speed_mps < 0.2);
        match (since, stands) {
            (None, true) => since = Some(i),
            (Some(from), false) => {
                let at_end = from == 0 || i == samples.len();
                if at_end || time_s[i - 1] - time_s[from] >= STOP_MIN_S {
                    stops.push((time_s[from], time_s[i - 1], samples[from].position_m));
                }
                since = None;
            }
            _ => {}
        }
    }
    stops
}

/// Chainages in m between which the mass cannot change, with the ends of the line.
pub fn stations(scan: &Scan) -> Vec<f64> {
    let Some([low, high]) = span_m(scan) else { return Vec::new() };
    let mut places: Vec<f64> =
        scan.problem.runs.iter().flat_map(stops).filter_map(|stop| stop.2).collect();
    places.sort_unstable_by(f64::total_cmp);
    let mut stations = vec![low - STATION_M];
    let mut group: Vec<f64> = Vec::new();
    for index in places.into_iter().chain([f64::INFINITY]) {
        if group.last().is_some_and(|last| index - last > STATION_M) {
            let station = group[group.len() / 2];
            // Beyond the last station nobody drives on.
            if station - low > STATION_M && high - station > STATION_M {
                stations.push(station);
            }
            group.clear();
        }
        group.push(index);
    }
    stations.push(high + STATION_M);
    stations
}
