//! Cases of the latency measurement, and the sets of cases that are measured together.

use dynocar::config::IdleStrategy;
use dynocar_shared::PipelineKind;

use crate::open_loop::sockets::COMPARED;
use crate::open_loop::trial::{Answerer, Companion, Setting};
use crate::rig::pipelines;

/// One line of the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatencyCase {
    /// `floor`, `dynocar/<pipeline>` or `alternative/<transport>`.
    pub name: String,
    /// The answering side, and the programs and candidates that run with it.
    pub setting: Setting,
}

impl LatencyCase {
    fn new(name: impl Into<String>, idle: IdleStrategy, answerer: Answerer) -> Self {
        let setting = Setting { answerer, idle, companions: &[], candidates: 0 };
        LatencyCase { name: name.into(), setting }
    }

    fn alone(kind: PipelineKind, idle: IdleStrategy) -> Self {
        LatencyCase::new(format!("dynocar/{kind}"), idle, Answerer::Daemon(vec![kind], Some(kind)))
    }

    /// Returns the compared pipeline, and behind it on its thread every other fast one.
    pub fn all_fast(idle: IdleStrategy) -> Self {
        LatencyCase::new("dynocar/all_fast", idle, all_fast(true))
    }

    /// Returns the compared pipeline with other readers of its channels, or with candidates on trial in its shadow.
    fn beside(
        what: &str,
        (companions, candidates): (&'static [Companion], u32),
        idle: IdleStrategy,
    ) -> Self {
        let LatencyCase { name, setting } = LatencyCase::alone(COMPARED, idle);
        let name = format!("{name}+{what}");
        LatencyCase { name, setting: Setting { companions, candidates, ..setting } }
    }

    /// Returns its name with its idle strategy.
    pub fn label(&self) -> String {
        format!("{} ({})", self.name, self.setting.idle)
    }

    /// Returns the strategy of the floor that this case is compared with: nothing is lower for an
    /// adaptive thread than one that never sleeps.
    pub fn floor_idle(&self) -> IdleStrategy {
        match self.setting.idle {
            IdleStrategy::Event => IdleStrategy::Event,
            IdleStrategy::Busy | IdleStrategy::Adaptive => IdleStrategy::Busy,
        }
    }
}

/// Returns the daemon with every fast pipeline, of which the compared one is the first or the last.
fn all_fast(is_first: bool) -> Answerer {
    let mut pipelines = pipelines::fast();
    pipelines.retain(|&kind| kind != COMPARED);
    pipelines.insert(if is_first { 0 } else { pipelines.len() }, COMPARED);
    Answerer::Daemon(pipelines, Some(COMPARED))
}

/// Returns every case, or the ones that a quick check runs.
pub fn cases(is_quick: bool) -> Vec<LatencyCase> {
    use IdleStrategy::{Adaptive, Busy, Event};
    let mut cases = vec![
        LatencyCase::new("floor", Busy, Answerer::Floor),
        LatencyCase::alone(COMPARED, Busy),
        LatencyCase::alone(COMPARED, Adaptive),
        LatencyCase::all_fast(Busy),
        LatencyCase::new("alternative/unix_datagram", Busy, Answerer::UnixDatagram),
        LatencyCase::new("floor", Event, Answerer::Floor),
        LatencyCase::alone(COMPARED, Event),
        LatencyCase::new("alternative/unix_datagram", Event, Answerer::UnixDatagram),
        #[cfg(feature = "zeromq")]
        LatencyCase::new("alternative/zeromq", Event, Answerer::ZeroMq),
    ];
    if !is_quick {
        cases.push(LatencyCase::new("dynocar/all_fast_last", Busy, all_fast(false)));
        cases.push(LatencyCase::alone(PipelineKind::Echo, Busy));
        let others = pipelines::fast().into_iter().filter(|&kind| kind != COMPARED);
        cases.extend(others.map(|kind| LatencyCase::alone(kind, Busy)));
    }
    cases
}

/// Returns the cases with other readers, whose programs must have been built.
pub fn cases_with_readers() -> Vec<LatencyCase> {
    use Companion::{Live, Recorder};
    let all: [(&str, &[Companion]); 3] =
        [("recorder", &[Recorder]), ("live", &[Live]), ("recorder+live", &[Recorder, Live])];
    let of = |idle| all.map(|(what, companions)| LatencyCase::beside(what, (companions, 0), idle));
    [of(IdleStrategy::Event), of(IdleStrategy::Busy)].concat()
}

/// Returns the cases with models on trial.
pub fn cases_in_shadow() -> Vec<LatencyCase> {
    [IdleStrategy::Event, IdleStrategy::Busy]
        .map(|idle| LatencyCase::beside("two_candidates", (&[], 2), idle))
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_floor_and_a_name_of_the_contract() {
        for is_quick in [false, true] {
            let cases = [cases(is_quick), cases_with_readers(), cases_in_shadow()].concat();
            for case in &cases {
                let floor = cases
                    .iter()
                    .find(|it| it.name == "floor" && it.setting.idle == case.floor_idle());
                assert!(floor.is_some(), "{}", case.name);
                let is_named = case.name == "floor"
                    || case.name.starts_with("dynocar/")
                    || case.name.starts_with("alternative/");
                assert!(is_named, "{}", case.name);
            }
        }
    }

    #[test]
    fn no_case_is_measured_twice() {
        let cases = [cases(false), cases_with_readers(), cases_in_shadow()].concat();
        for (index, case) in cases.iter().enumerate() {
            let same = |it: &LatencyCase| it.label() == case.label();
            assert_eq!(cases.iter().position(same), Some(index));
        }
    }
}
