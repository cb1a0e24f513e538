//! All trains of a service with one of the three kinds of parameters.

use clap::Args;
use dynocar_shared::TrainSample;

use super::deviations::Service;
use super::journey::{DrivenLeg, Journey};
use super::link::{self, ASKED, AnswerMemory, Link};
use super::train::Train;
use crate::ending;
use crate::output::BenchError;
use crate::scenarios::score::QuantityScore;

/// Source of the driver's parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Informant {
    /// The declared parameters.
    Declared,
    /// The daemon's answers where they are usable, else the declared parameters.
    Dynocar,
    /// The true parameters: the best attainable result.
    Truth,
}

impl Informant {
    /// All sources with their names.
    pub const ALL: [(Informant, &str); 3] = [
        (Informant::Declared, "declared"),
        (Informant::Dynocar, "dynocar"),
        (Informant::Truth, "true"),
    ];
}

/// Which trains drive how far.
#[derive(Clone, Copy, Debug, Args)]
pub struct DriveExtent {
    /// Trains for each scenario, each with a seed of its own
    #[arg(long, default_value_t = 20)]
    pub trains: usize,
    /// Stops of each train
    #[arg(long, default_value_t = 10)]
    pub stops: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
}

/// Record of a driven train.
#[derive(Clone, Debug)]
pub struct DrivenRecord {
    /// Its legs.
    pub legs: Vec<DrivenLeg>,
    /// Scores of the daemon's answers, by [`ASKED`].
    pub scores: [QuantityScore; 4],
}

/// A train on its way, with the daemon's answers that its driver keeps.
struct Driving {
    journey: Journey,
    memory: AnswerMemory,
    scores: [QuantityScore; 4],
}

impl Driving {
    /// One cycle of a driver that asks the daemon.
    fn ask(&mut self, train: usize, sample: &TrainSample, link: &Link) {
        let declared = self.journey.declared(sample);
        let is_usable = ASKED.map(|quantity| link.usable(train, quantity).is_some());
        let friction = self.journey.train.gear.friction;
        let learned = link::learned(&declared, friction, sample.speed_mps, |quantity| {
            link.usable(train, quantity)
        });
        let is_braking = self.journey.is_braking();
        let train = &self.journey.train;
        link::count(&mut self.scores, train, is_braking, &declared, &learned, is_usable);
        let known = self.memory.recall(&learned, is_usable, is_braking);
        self.journey.proceed(sample, &known, &learned);
    }
}

/// Drives every train of a service, all of them cycle by cycle.
///
/// # Errors
///
/// When the daemon or its channels cannot be had, or samples are lost while there is a daemon.
pub fn drive(
    service: Service,
    informant: Informant,
    extent: DriveExtent,
) -> Result<Vec<DrivenRecord>, BenchError> {
    let DriveExtent { trains, stops, first_seed } = extent;
    let mut link = match informant {
        Informant::Dynocar => Some(Link::open(&service.declared(), trains)?),
        Informant::Declared | Informant::Truth => None,
    };
    let mut all: Vec<Driving> = (first_seed..first_seed + trains as u64)
        .map(|seed| Driving {
            journey: Journey::new(Train::new(service, seed)),
            memory: AnswerMemory::default(),
            scores: Default::default(),
        })
        .collect();
    let dies = service.condition.daemon_dies;
    let mut death = if dies { Death::On(stops / 3) } else { Death::Never };
    loop {
        if ending::is_due() {
            return Err("ended on the way".into());
        }
        let on_the_way = |(_, it): &(usize, &mut Driving)| it.journey.legs.len() < stops;
        let mut samples: Vec<(usize, TrainSample)> = all
            .iter_mut()
            .enumerate()
            .filter(on_the_way)
            .map(|(index, it)| (index, it.journey.train.sample()))
            .collect();
        if samples.is_empty() {
            break;
        }
        if let Some(link) = &mut link {
            death.come(&service, &all[0].journey, link)?;
            link.exchange(&mut samples)?;
        }
        for (index, sample) in &samples {
            let driving = &mut all[*index];
            if let Some(link) = &link {
                driving.ask(*index, sample, link);
                continue;
            }
            let known = match informant {
                Informant::Truth => driving.journey.train.truth(),
                _ => driving.journey.declared(sample),
            };
            driving.journey.proceed(sample, &known, &known);
        }
    }
    let lost = link.as_ref().map_or(0, Link::lost);
    if lost > 0 && !dies {
        return Err(format!("daemon: {lost} samples were lost in lock-step").into());
    }
    Ok(all
        .into_iter()
        .map(|it| DrivenRecord { legs: it.journey.legs, scores: it.scores })
        .collect())
}

/// Time in s on a leg at which the daemon dies, or another comes.
const MIDWAY_S: f64 = 40.0;
/// Time in ms for which a driver does not yet know that the daemon is gone, as a reader presumes.
const UNNOTICED_MS: u32 = 250;

/// Ways in which the daemon dies, by the first train's legs.
#[derive(Clone, Copy, Debug)]
enum Death {
    /// It stays, or another has come.
    Never,
    /// It dies in the middle of this leg.
    On(usize),
    /// The daemon is dead for this many cycles; another comes in the middle of this leg.
    Until(usize, u32),
}

impl Death {
    fn come(
        &mut self,
        service: &Service,
        first: &Journey,
        link: &mut Link,
    ) -> Result<(), BenchError> {
        let (legs, running_s) = (first.legs.len(), first.running_s());
        let is_midway = |leg: usize| legs > leg || (legs == leg && running_s >= MIDWAY_S);
        match *self {
            Death::On(leg) if is_midway(leg) => {
                link.kill_daemon();
                *self = Death::Until(leg + 1, 0);
            }
            Death::Until(leg, _) if is_midway(leg) => {
                link.start_daemon()?;
                *self = Death::Never;
            }
            Death::Until(leg, cycles) => {
                if cycles + 1 == UNNOTICED_MS.div_ceil(service.cycle_ms) {
                    link.notice_silence();
                }
                *self = Death::Until(leg, cycles + 1);
            }
            Death::Never | Death::On(_) => {}
        }
        Ok(())
    }
}
