//! All trains of a service with one of the three kinds of parameters.

use dynocar_shared::TrainSample;

use super::answers::{self, ASKED, Memory, Use};
use super::journey::{DrivenLeg, Journey};
use super::line::{Condition, Service};
use super::link::Link;
use super::train::Train;
use crate::output::Failure;

/// By which parameters the driver drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Informant {
    /// As declared.
    Declared,
    /// As the daemon says, where it may be used.
    Dynocar,
    /// The true ones: what is attainable.
    Truth,
}

impl Informant {
    /// All of them.
    pub const ALL: [Informant; 3] = [Informant::Declared, Informant::Dynocar, Informant::Truth];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Informant::Declared => "declared",
            Informant::Dynocar => "Dynocar",
            Informant::Truth => "true",
        }
    }
}

/// Which trains drive how far.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Trains, each with a seed of its own.
    pub trains: usize,
    /// Stops of each.
    pub stops: usize,
    /// The first seed.
    pub first_seed: u64,
}

/// What a train did.
#[derive(Clone, Debug)]
pub struct Driven {
    /// Its legs.
    pub legs: Vec<DrivenLeg>,
    /// What the daemon's answers were worth.
    pub uses: [Use; 4],
}

/// A train that asks the daemon.
struct Asking {
    journey: Journey,
    memory: Memory,
    uses: [Use; 4],
}

impl Asking {
    fn proceed(&mut self, train: usize, sample: &TrainSample, link: &Link) {
        let declared = self.journey.declared(sample);
        let is_usable = ASKED.map(|quantity| link.usable(train, quantity).is_some());
        let friction = self.journey.train.declared_friction();
        let learned = answers::learned(&declared, friction, sample.speed_mps, |quantity| {
            link.usable(train, quantity)
        });
        let is_braking = self.journey.is_braking();
        let train = &self.journey.train;
        answers::count(&mut self.uses, train, is_braking, &declared, &learned, is_usable);
        let known = self.memory.recall(&learned, is_usable, is_braking);
        self.journey.proceed(sample, &known, &learned);
    }
}

/// Drives every train of a service.
///
/// # Errors
///
/// When the daemon or its channels cannot be had, or samples are lost while there is a daemon.
pub fn drive(
    service: Service,
    informant: Informant,
    extent: Extent,
) -> Result<Vec<Driven>, Failure> {
    let seeds = extent.first_seed..extent.first_seed + extent.trains as u64;
    let trains = seeds.map(|seed| Train::new(service, seed));
    if informant == Informant::Dynocar {
        return with_daemon(service, trains.collect(), extent.stops);
    }
    let alone = |train| {
        let mut journey = Journey::new(train);
        while journey.legs.len() < extent.stops {
            let sample = journey.train.sample();
            let known = match informant {
                Informant::Truth => journey.train.truth(),
                _ => journey.declared(&sample),
            };
            journey.proceed(&sample, &known, &known);
        }
        Driven { legs: journey.legs, uses: [Use::default(); 4] }
    };
    Ok(trains.map(alone).collect())
}

/// Cycles in which a driver does not yet know that the daemon is gone: 250 ms, as a reader presumes.
fn cycles_unnoticed(service: &Service) -> u32 {
    250_u32.div_ceil(service.cycle_ms)
}

fn with_daemon(service: Service, trains: Vec<Train>, stops: usize) -> Result<Vec<Driven>, Failure> {
    let mut link = Link::open(&service.declared(), trains.len())?;
    let mut asking: Vec<Asking> = trains
        .into_iter()
        .map(|train| Asking {
            journey: Journey::new(train),
            memory: Memory::default(),
            uses: [Use::default(); 4],
        })
        .collect();
    let (mut death, mut silent_cycles) = (Death::of(&asking[0], stops), 0);
    loop {
        let mut samples: Vec<(usize, TrainSample)> = asking
            .iter_mut()
            .enumerate()
            .filter(|(_, it)| it.journey.legs.len() < stops)
            .map(|(index, it)| (index, it.journey.train.sample()))
            .collect();
        if samples.is_empty() {
            break;
        }
        if let Some(left) = &mut death {
            if !left.is_dead && left.is_reached(&asking[0].journey, left.kill_at) {
                link.kill_daemon();
                left.is_dead = true;
            } else if left.is_dead && left.is_reached(&asking[0].journey, left.return_at) {
                link.start_daemon()?;
                death = None;
            } else if left.is_dead {
                silent_cycles += 1;
                if silent_cycles == cycles_unnoticed(&service) {
                    link.notice_silence();
                }
            }
        }
        link.exchange(&mut samples)?;
        for (index, sample) in &samples {
            asking[*index].proceed(*index, sample, &link);
        }
    }
    let lost = link.lost();
    if lost > 0 && service.condition != Condition::DaemonDies {
        return Err(format!("daemon: {lost} samples were lost in lock-step").into());
    }
    Ok(asking.into_iter().map(|it| Driven { legs: it.journey.legs, uses: it.uses }).collect())
}

/// When the daemon dies and another comes, by the first train's leg and time on it.
#[derive(Clone, Copy, Debug)]
struct Death {
    kill_at: (usize, f64),
    return_at: (usize, f64),
    is_dead: bool,
}

impl Death {
    /// In the middle of the leg after a third of the stops; another comes in the middle of the next.
    fn of(first: &Asking, stops: usize) -> Option<Self> {
        let (leg, time_s) = (stops / 3, 40.0);
        first.journey.train.loses_daemon().then_some(Death {
            kill_at: (leg, time_s),
            return_at: (leg + 1, time_s),
            is_dead: false,
        })
    }

    fn is_reached(&self, first: &Journey, (leg, time_s): (usize, f64)) -> bool {
        first.legs.len() > leg || (first.legs.len() == leg && first.running_s() >= time_s)
    }
}
