//! Part of the line or of a run where a mass holds: it changes only while the train stands.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::track::MassSection;

use crate::explain::answer::RunWindow;
use crate::explain::evidence::RunData;
use crate::explain::places::span_m;
use crate::explain::scan::Scan;

/// Shortest stop in s at which people get on or off.
pub const STOP_MIN_S: f64 = 8.0;
/// Stops within this distance in m are one station.
pub const STATION_M: f64 = 350.0;

/// Part where one mass factor holds, from one end to the other.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorPart {
    /// Both ends: chainages in m or times in s since the run's first sample.
    pub ends: [f64; 2],
    /// The axis of the ends.
    pub along: Along,
}

/// Axis along which a part lies.
#[derive(Clone, Debug, PartialEq)]
pub enum Along {
    /// The line; without a direction the same in both.
    Line(Option<f64>),
    /// The time of a run, by its file; with the time in s of its first sample in the recording's own count.
    Run(String, f64),
}

impl FactorPart {
    /// True when it may hold in a run.
    pub fn is_in(&self, run: &RunData) -> bool {
        match &self.along {
            Along::Line(_) => true,
            Along::Run(file, _) => *file == run.file,
        }
    }

    /// True when sample number `index` of a run in which it may hold lies in it.
    #[inline]
    pub fn holds(&self, run: &RunData, index: usize) -> bool {
        let [from, to] = self.ends;
        match &self.along {
            Along::Line(direction) => {
                let (from_m, to_m, towards) = (from, to, run.directions[index]);
                let direction = direction.unwrap_or(towards);
                let section = MassSection { from_m, to_m, direction, mass_factor: 1.0 };
                let at_m = run.covariate(Covariate::Chainage)[index];
                !at_m.is_nan() && section.holds(at_m, towards)
            }
            Along::Run(..) => (from..=to).contains(&run.recording.time_s()[index]),
        }
    }

    /// The directions in which a section holds; none of a window.
    pub fn directions(&self) -> Vec<f64> {
        match self.along {
            Along::Line(direction) => direction.map_or(vec![1.0, -1.0], |it| vec![it]),
            Along::Run(..) => Vec::new(),
        }
    }

    /// The window of a run; `None` for a section of the line.
    pub fn window(&self) -> Option<RunWindow> {
        let Along::Run(run, offset_s) = &self.along else { return None };
        let [t_start_s, t_end_s] = self.ends.map(|at_s| offset_s + at_s);
        Some(RunWindow { run: run.clone(), t_start_s, t_end_s })
    }

    /// The same with one end elsewhere; `None` when nothing would be left.
    pub fn with_end(&self, is_upper: bool, at: f64) -> Option<FactorPart> {
        let mut moved = self.clone();
        moved.ends[usize::from(is_upper)] = at;
        (moved.ends[0] < moved.ends[1]).then_some(moved)
    }

    /// Ends of those of some parts that lie along the same axis, in ascending order.
    pub fn edges<'p>(&self, parts: impl Iterator<Item = &'p FactorPart>) -> Vec<f64> {
        let same = parts.filter(|other| self.along == other.along);
        let mut edges: Vec<f64> = same.flat_map(|part| part.ends).collect();
        edges.sort_unstable_by(f64::total_cmp);
        edges.dedup();
        edges
    }

    /// True when two parts share no sample.
    pub fn is_apart(&self, other: &FactorPart) -> bool {
        let ([from, to], [other_from, other_to]) = (self.ends, other.ends);
        let do_not_meet = to <= other_from || other_to <= from;
        match (&self.along, &other.along) {
            (Along::Line(one), Along::Line(other)) => {
                do_not_meet || one.zip(*other).is_some_and(|(one, other)| one != other)
            }
            (Along::Run(one, _), Along::Run(other, _)) => one != other || do_not_meet,
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
