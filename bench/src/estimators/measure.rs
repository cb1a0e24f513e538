//! Timing of an estimator compared with its peers, in interleaved rounds.
//!
//! Every contender of a case works on the same data. A round times each of them once, in an
//! order that turns from round to round, so that a busy machine slows all alike; ratios are
//! taken round by round. Before any timing the answers must agree.
//!
//! The clock is the thread's processor time: what other programs take meanwhile does not count.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

use crate::output::{Failure, Record};
use crate::statistics::quantiles;

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
    /// A contender by its name, updates in a pass, and a pass over the data of the case.
    pub fn new<D: ?Sized + 'static>(
        name: &str,
        updates: usize,
        data: &Arc<D>,
        mut pass: impl FnMut(&D) -> Vec<f64> + 'static,
    ) -> Self {
        let data = Arc::clone(data);
        Contender { name: name.into(), updates, pass: Box::new(move || pass(&data)) }
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

/// Lower quartile, median and upper quartile of at least one value.
pub fn quartiles(values: Vec<f64>) -> [f64; 3] {
    quantiles(values, [0.25, 0.5, 0.75]).unwrap_or([f64::NAN; 3])
}

impl Case {
    /// A case without peers and without an aim.
    pub fn new(name: impl Into<String>, agreement: Agreement, ours: Contender) -> Self {
        Case { name: name.into(), target_ns: None, ours, peers: Vec::new(), agreement }
    }

    /// With one more peer.
    #[must_use]
    pub fn peer(mut self, peer: Contender) -> Self {
        self.peers.push(peer);
        self
    }

    /// With an aim in ns.
    #[must_use]
    pub fn aim(self, target_ns: f64) -> Self {
        Case { target_ns: Some(target_ns), ..self }
    }

    /// Runs every contender once and compares the answers.
    ///
    /// # Errors
    ///
    /// The first peer whose answer differs from ours.
    pub fn check(&mut self) -> Result<(), Failure> {
        let ours = (self.ours.pass)();
        for peer in &mut self.peers {
            let share = self.agreement.difference(&ours, &(peer.pass)());
            if share > 1.0 {
                let (case, peer) = (&self.name, &peer.name);
                let words = format!("expected {peer} to agree with ours, {share:.3} times");
                return Err(format!("{case}: {words} the tolerance apart").into());
            }
        }
        Ok(())
    }

    /// Checks the answers, warms up and measures: the median time of an update over the rounds, half the distance of
    /// its quartiles, what is aimed at, and of a peer the median over the rounds of its time over ours. Ours comes
    /// first.
    ///
    /// # Errors
    ///
    /// The first peer whose answer differs from ours.
    pub fn measure(mut self, effort: &Effort) -> Result<Vec<Record>, Failure> {
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
        let record = |(index, contender): (usize, &&mut Contender)| {
            let [low, median, high] = quartiles(times[index].clone());
            let target_ns = self.target_ns.filter(|_| index == 0);
            let met = target_ns.map_or("", |most| if median < most { "yes" } else { "NO" });
            let ratios = times[index].iter().zip(&times[0]).map(|(own, ours)| own / ours);
            let name = match index {
                0 => self.name.clone(),
                _ => format!("{} ({})", self.name, contender.name),
            };
            Record::default()
                .with("case", &name)
                .shown("ns", nanoseconds(median), median)
                .number("spread %", 50.0 * (high - low) / median, 0)
                .shown("target ns", target_ns.map_or(String::new(), nanoseconds), target_ns)
                .with("met", met)
                .number("peer / ours", (index > 0).then(|| quartiles(ratios.collect())[1]), 2)
                // What another build of this program reads.
                .for_machines("name", name)
                .for_machines("peer", index > 0)
                .for_machines("ns_per_update", median)
        };
        Ok(contenders.iter().enumerate().map(record).collect())
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

/// Three significant digits below 100, groups of thousands above.
fn nanoseconds(value: f64) -> String {
    if value < 100.0 {
        return format!("{value:.1}");
    }
    let digits = format!("{value:.0}").into_bytes();
    let groups = digits.rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_with_another_answer_is_refused() {
        let contender =
            |answer: f64| Contender::new("x", 1, &Arc::new(answer), |answer| vec![*answer]);
        let case = |peer: f64| {
            Case::new("case", Agreement::Relative(1e-3), contender(1.0)).peer(contender(peer))
        };
        assert!(case(1.0005).check().is_ok());
        assert!(case(1.002).check().is_err());
        assert!(case(f64::NAN).check().is_err());
    }

    #[test]
    fn peers_follow_ours_and_only_ours_has_a_target() {
        let contender = |name: &str| Contender::new(name, 1, &Arc::new(()), |_| vec![1.0]);
        let case = Case::new("c", Agreement::Relative(1e-6), contender("ours"));
        let case = case.peer(contender("p")).aim(1e9);
        let records = case.measure(&Effort { rounds: 1, slice: Duration::ZERO }).unwrap();
        let of = |row: usize, name: &str| records[row].cell(name).unwrap();
        assert_eq!((of(0, "case"), of(0, "met"), of(0, "peer / ours")), ("c", "yes", ""));
        assert_eq!((of(1, "case"), of(1, "met"), of(1, "target ns")), ("c (p)", "", ""));
        assert!(records[1].value("peer / ours").is_some());
    }

    #[test]
    fn thousands_are_grouped() {
        assert_eq!(nanoseconds(41.26), "41.3");
        assert_eq!(nanoseconds(987.6), "988");
        assert_eq!(nanoseconds(1_234_567.0), "1 234 567");
    }
}
