//! Forces as they act, some time after their report.

/// Number of reports kept: more than a second of them at 50 per second; of faster reports the history is shorter.
const CAPACITY: usize = 64;

/// A report: time in s, forces in N/kN, and their impulses in N/kN s since the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Report {
    time_s: f64,
    forces: [f64; 2],
    impulses: [f64; 2],
}

/// Traction and brake force of the last moments, joined by straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceHistory {
    reports: [Report; CAPACITY],
    newest: usize,
    count: usize,
    segment: u32,
    origin_ns: i64,
}

/// Forces over a step: traction, then brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acting {
    /// Time in s between the report of the force and the force itself.
    pub delay_s: f64,
    /// Impulse in N/kN s.
    pub impulses: [f64; 2],
    /// Change of the force in N/kN from the beginning of the step to its end.
    pub changes: [f64; 2],
}

impl Default for ForceHistory {
    fn default() -> Self {
        ForceHistory {
            reports: [Report::default(); CAPACITY],
            newest: 0,
            count: 0,
            segment: 0,
            origin_ns: 0,
        }
    }
}

impl ForceHistory {
    /// Takes in a report of traction and brake force in N/kN; a new segment erases the reports before it.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn see(&mut self, (time_ns, segment): (i64, u32), forces: [f64; 2]) {
        if self.count == 0 || segment != self.segment {
            (self.count, self.newest) = (0, 0);
            (self.segment, self.origin_ns) = (segment, time_ns);
        }
        let time_s = time_ns.saturating_sub(self.origin_ns) as f64 * 1e-9;
        let last = self.reports[self.newest];
        let step_s = time_s - last.time_s;
        let impulses = match self.count {
            0 => [0.0; 2],
            _ => [0, 1].map(|k| last.impulses[k] + 0.5 * step_s * (last.forces[k] + forces[k])),
        };
        self.newest = (self.newest + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
        self.reports[self.newest] = Report { time_s, forces, impulses };
    }

    /// Returns the forces over the step of `step_s` that ends with the newest report, if they act by `delay_s`
    /// behind their report, or by as much as is stored of them.
    ///
    /// # Real-time
    ///
    /// Work in proportion to the reports within the delay, no allocation.
    pub fn over(&self, step_s: f64, delay_s: f64) -> Acting {
        let (newest, oldest) = (self.back(0), self.back(self.count.saturating_sub(1)));
        let most_s = (newest.time_s - oldest.time_s - step_s).max(0.0);
        let delay_s = delay_s.clamp(0.0, most_s);
        let mut back = 0;
        let end = self.at(newest.time_s - delay_s, &mut back);
        let start = self.at(newest.time_s - delay_s - step_s, &mut back);
        Acting {
            delay_s,
            impulses: [0, 1].map(|k| end.impulses[k] - start.impulses[k]),
            changes: [0, 1].map(|k| end.forces[k] - start.forces[k]),
        }
    }

    /// Returns the report `count` before the newest.
    fn back(&self, count: usize) -> &Report {
        &self.reports[(self.newest + CAPACITY - count) % CAPACITY]
    }

    /// Forces and impulses at a time in s, looked for from a report on.
    fn at(&self, time_s: f64, back: &mut usize) -> Report {
        while *back + 2 < self.count && self.back(*back + 1).time_s >= time_s {
            *back += 1;
        }
        let (from, to) = (self.back(*back + 1), self.back(*back));
        let since_s = time_s - from.time_s;
        let step_s = to.time_s - from.time_s;
        let slopes = [0, 1]
            .map(|k| if step_s > 0.0 { (to.forces[k] - from.forces[k]) / step_s } else { 0.0 });
        Report {
            time_s,
            forces: [0, 1].map(|k| from.forces[k] + since_s * slopes[k]),
            impulses: [0, 1]
                .map(|k| from.impulses[k] + since_s * (from.forces[k] + 0.5 * since_s * slopes[k])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.1;

    /// Forces that rise from 1 s on, as reported up to a time in s.
    fn reported(until_s: f64) -> ForceHistory {
        let mut forces = ForceHistory::default();
        for k in 0..=(until_s / STEP_S).round() as i64 {
            let time_s = k as f64 * STEP_S;
            let ramp = (time_s - 1.0).max(0.0);
            forces.see((5_000_000_000 + k * 100_000_000, 1), [6.0 * ramp, 2.0]);
        }
        forces
    }

    #[test]
    fn a_force_acts_later_by_its_delay_also_between_reports() {
        for (until_s, delay_s) in [(3.0, 0.0), (3.0, 0.23), (3.0, 0.7), (1.3, 0.25), (1.1, 0.25)] {
            let acting = reported(until_s).over(STEP_S, delay_s);
            let impulse = |time_s: f64| 3.0 * (time_s - delay_s - 1.0).max(0.0).powi(2);
            let force = |time_s: f64| 6.0 * (time_s - delay_s - 1.0).max(0.0);
            let start_s = until_s - STEP_S;
            assert!((acting.delay_s - delay_s).abs() < 1e-9);
            assert!((acting.impulses[0] - (impulse(until_s) - impulse(start_s))).abs() < 1e-9);
            assert!((acting.changes[0] - (force(until_s) - force(start_s))).abs() < 1e-9);
            assert!(
                (acting.impulses[1] - 2.0 * STEP_S).abs() < 1e-9 && acting.changes[1].abs() < 1e-9
            );
        }
    }

    #[test]
    fn what_is_not_kept_is_not_looked_back_to() {
        let acting = reported(20.0).over(STEP_S, 9.0);
        assert!((acting.delay_s - (CAPACITY as f64 - 2.0) * STEP_S).abs() < 1e-6);
        assert!((reported(0.3).over(STEP_S, 1.0).delay_s - 0.2).abs() < 1e-9);
        let mut forces = reported(20.0);
        forces.see((26_000_000_000, 2), [9.0, 0.0]);
        forces.see((26_100_000_000, 2), [9.0, 0.0]);
        let acting = forces.over(STEP_S, 0.5);
        assert_eq!((acting.delay_s, acting.changes), (0.0, [0.0; 2]));
        assert!((acting.impulses[0] - 0.9).abs() < 1e-9);
    }
}
