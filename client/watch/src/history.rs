//! The last minutes of one pipeline, a point a second.

use std::collections::VecDeque;

use dynocar_shared::ParameterSnapshot;

/// Points that are kept: ten minutes.
const POINTS: usize = 600;

/// What is plotted of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Unexplained force in kN, retarding positive.
    pub unexplained_kn: f64,
    /// Evidence for the suspected effect.
    pub evidence: f64,
}

/// Points, the newest last, and the rate of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    points: VecDeque<Point>,
    /// Host's time in ns and sequence number of the newest sample, a second ago.
    last: Option<(i64, u64)>,
    rate_hz: Option<f64>,
}

impl History {
    /// Takes a point; call it once a second, with the host's time in ns.
    pub fn push(&mut self, snapshot: &ParameterSnapshot, now_ns: i64) {
        if self.points.len() == POINTS {
            self.points.pop_front();
        }
        self.points.push_back(Point {
            unexplained_kn: 1e-3 * snapshot.unexplained_force_n,
            evidence: snapshot.suspicion_evidence,
        });
        let before = self.last.replace((now_ns, snapshot.sample_sequence));
        self.rate_hz = before.and_then(|(then_ns, sequence)| {
            let samples = snapshot.sample_sequence.checked_sub(sequence)?;
            let elapsed_s = 1e-9 * (now_ns - then_ns) as f64;
            (elapsed_s > 0.0).then_some(samples as f64 / elapsed_s)
        });
    }

    /// Samples a second lately.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// The newest points, at most so many, the oldest first.
    pub fn newest(&self, count: usize) -> impl Iterator<Item = &Point> + Clone {
        self.points.iter().skip(self.points.len().saturating_sub(count))
    }
}
