//! Timing of an estimator compared with its peers, in interleaved rounds.
//!
//! Every contender of a case works on the same data. A round times each of them once, in an
//! order that turns from round to round, so that a busy machine slows all alike; ratios are
//! taken round by round. Before any timing the answers must agree.
//!
//! The clock is the thread's processor time: what other programs take meanwhile does not count.

use std::hint::black_box;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// One way to do the work of a case.
pub struct Contender {
    /// Its name in the table.
    pub name: String,
    /// Updates in a pass.
    pub updates: usize,
    /// Goes through all data once from a fresh start and gives what was estimated.
    pub pass: Box<dyn FnMut() -> Vec<f64>>,
}

impl Contender {
    /// A contender by its name, updates in a pass, and pass.
    pub fn new(name: &str, updates: usize, pass: impl FnMut() -> Vec<f64> + 'static) -> Self {
        Contender { name: name.into(), updates, pass: Box::new(pass) }
    }
}

/// By how much the answers of two contenders may differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Agreement {
    /// Each number by a share of itself.
    Relative(f64),
    /// Each number by so much.
    Absolute(f64),
}

impl Agreement {
    /// The greatest difference of two answers as a share of what is allowed: at most 1 when
    /// they agree; infinite for answers of different length or with a NaN.
    pub fn difference(self, ours: &[f64], peer: &[f64]) -> f64 {
        if ours.len() != peer.len() {
            return f64::INFINITY;
        }
        let of_pair = |(a, b): (&f64, &f64)| {
            let apart = (a - b).abs();
            let share = match self {
                Agreement::Relative(_) if apart == 0.0 => 0.0,
                Agreement::Relative(allowed) => apart / (allowed * a.abs().max(b.abs())),
                Agreement::Absolute(allowed) => apart / allowed,
            };
            if share.is_nan() { f64::INFINITY } else { share }
        };
        ours.iter().zip(peer).map(of_pair).fold(0.0, f64::max)
    }
}

/// An estimator of ours with its peers.
pub struct Case {
    /// Name of the work, in the table and in JSON.
    pub name: String,
    /// Time of an update in ns that is aimed at.
    pub target_ns: Option<f64>,
    /// Ours.
    pub ours: Contender,
    /// The peers, on the same data.
    pub peers: Vec<Contender>,
    /// By how much a peer's answer may differ from ours.
    pub agreement: Agreement,
}

/// How long to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Rounds.
    pub rounds: usize,
    /// Least time of one contender in a round.
    pub slice: Duration,
}

impl Effort {
    /// A measurement: odd numbers of rounds have a middle.
    pub const FULL: Effort = Effort { rounds: 31, slice: Duration::from_millis(5) };
    /// A check that everything runs.
    pub const QUICK: Effort = Effort { rounds: 5, slice: Duration::from_millis(1) };
}

/// Median and quartiles over the rounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Lower quartile.
    pub low: f64,
    /// Median.
    pub median: f64,
    /// Upper quartile.
    pub high: f64,
}

impl Spread {
    /// Of at least one value; quartiles by the nearest rank.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
        Spread { low: at(0.25), median: at(0.5), high: at(0.75) }
    }

    /// Half the distance of the quartiles as a share of the median.
    pub fn relative(&self) -> f64 {
        0.5 * (self.high - self.low) / self.median
    }
}

/// Time of a peer and of ours.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerTime {
    /// Name of the peer.
    pub name: String,
    /// Time of an update in ns.
    pub ns: Spread,
    /// Its time over ours: how many times faster ours is.
    pub ratio: Spread,
}

/// Times of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseTimes {
    /// Name of the work.
    pub name: String,
    /// Target of an update in ns.
    pub target_ns: Option<f64>,
    /// Time of an update of ours in ns.
    pub ours_ns: Spread,
    /// The peers.
    pub peers: Vec<PeerTime>,
}

/// An answer of a peer is not ours.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{case}: expected {peer} to agree with ours, {share:.3} times the tolerance apart")]
pub struct Disagreement {
    /// Name of the work.
    pub case: String,
    /// Name of the peer.
    pub peer: String,
    /// Difference over tolerance.
    pub share: f64,
}

impl Case {
    /// Runs every contender once and compares the answers.
    ///
    /// # Errors
    ///
    /// The first peer whose answer differs from ours.
    pub fn check(&mut self) -> Result<(), Disagreement> {
        let ours = (self.ours.pass)();
        for peer in &mut self.peers {
            let share = self.agreement.difference(&ours, &(peer.pass)());
            if share > 1.0 {
                let (case, peer) = (self.name.clone(), peer.name.clone());
                return Err(Disagreement { case, peer, share });
            }
        }
        Ok(())
    }

    /// Checks the answers, warms up and measures.
    ///
    /// # Errors
    ///
    /// The first peer whose answer differs from ours.
    pub fn measure(mut self, effort: &Effort) -> Result<CaseTimes, Disagreement> {
        self.check()?;
        let mut contenders: Vec<_> =
            std::iter::once(&mut self.ours).chain(&mut self.peers).collect();
        let passes: Vec<_> =
            contenders.iter_mut().map(|contender| calibrate(contender, effort)).collect();
        let mut times = vec![Vec::with_capacity(effort.rounds); contenders.len()];
        for round in 0..effort.rounds {
            for turn in 0..contenders.len() {
                let index = (round + turn) % contenders.len();
                times[index].push(time(contenders[index], passes[index]));
            }
        }
        let peers = self.peers.iter().zip(&times[1..]).map(|(peer, peer_times)| PeerTime {
            name: peer.name.clone(),
            ns: Spread::of(peer_times.clone()),
            ratio: Spread::of(peer_times.iter().zip(&times[0]).map(|(p, o)| p / o).collect()),
        });
        Ok(CaseTimes {
            peers: peers.collect(),
            name: self.name,
            target_ns: self.target_ns,
            ours_ns: Spread::of(times[0].clone()),
        })
    }
}

/// Passes that fill a slice of time; doubles as the warm-up.
fn calibrate(contender: &mut Contender, effort: &Effort) -> usize {
    let mut passes = 1;
    while processor_time(contender, passes) < effort.slice {
        passes *= 2;
    }
    passes
}

/// Time of an update in ns.
fn time(contender: &mut Contender, passes: usize) -> f64 {
    let updates = (passes * contender.updates) as f64;
    processor_time(contender, passes).as_secs_f64() * 1e9 / updates
}

fn processor_time(contender: &mut Contender, passes: usize) -> Duration {
    let start = now();
    for _ in 0..passes {
        black_box((contender.pass)());
    }
    now().saturating_sub(start)
}

/// Processor time of this thread so far.
fn now() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_with_another_answer_is_refused() {
        let contender = |answer: f64| Contender::new("x", 1, move || vec![answer]);
        let case = |peer: f64| Case {
            name: "case".into(),
            target_ns: None,
            ours: contender(1.0),
            peers: vec![contender(peer)],
            agreement: Agreement::Relative(1e-3),
        };
        assert!(case(1.0005).check().is_ok());
        assert!(case(1.002).check().is_err());
        assert!(case(f64::NAN).check().is_err());
    }

    #[test]
    fn the_spread_is_that_of_the_middle_half() {
        let spread = Spread::of(vec![5.0, 1.0, 100.0, 2.0, 3.0]);
        assert_eq!(spread, Spread { low: 2.0, median: 3.0, high: 5.0 });
        assert_eq!(spread.relative(), 0.5);
    }
}
