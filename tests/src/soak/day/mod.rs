//! A day of eight trains in accelerated time: the whole default set of pipelines, samples with the trains' own stamps
//! as fast as the daemon takes them, and a disturbance in each quarter of an hour.
//!
//! - [`train`]: one train with its controller and client
//! - [`strange_host`]: a daemon whose wall clock jumps and whose disk fills
//! - [`hours`]: the outcome of an hour

pub mod hours;
pub mod strange_host;
pub mod train;

use std::path::{Path, PathBuf};

use dynocar::state::{file, path_of};
use dynocar_shared::TrainId;
use rustix::process::Signal;

use super::Programs;
use super::load::{GROWTH_MAX_KIB, TRAINS, resident_kib};
use crate::process::{DaemonSite, Process, await_true};
use hours::{Hour, quantiles};
use strange_host::StrangeHost;
use train::{DayTrain, TrainAccount};

/// The daemon's file as it is shipped: its pipelines are the default set.
const SHIPPED: &str = include_str!("../../../../config/daemon.toml");
/// Samples of a train that are on their way together.
const BATCH: usize = 16;
/// Number of samples that exceeds the daemon's buffers.
const FLOOD: usize = 700;
const QUARTER_NS: i64 = 900_000_000_000;
/// How far the wall clock is ahead in s, hour by hour.
const CLOCK_AHEAD_S: [i64; 4] = [90, -3_600, 2 * 86_400, 0];
/// The same for the last daemon: by the wall clock its state were too old.
const FAR_AHEAD_S: i64 = 40 * 86_400;
/// By how much a controller's own clock is set back.
const SET_BACK_NS: i64 = 30_000_000_000;

/// The trouble of a quarter of an hour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trouble {
    /// A client comes, and the one before dies.
    Client,
    /// The disk of the states is full but for a few bytes.
    FullDisk,
    /// The wall clock jumps, a controller's clock too, and a train is not driven.
    Clock,
    /// The daemon stands still while samples come.
    Standstill,
}

const TROUBLES: [Trouble; 4] =
    [Trouble::Client, Trouble::FullDisk, Trouble::Clock, Trouble::Standstill];

/// The daemon with all that is around it.
struct Day<'a> {
    site: DaemonSite,
    programs: &'a Programs,
    config: PathBuf,
    states: PathBuf,
    strange: StrangeHost,
    daemon: Process,
    pipelines: usize,
    trains: Vec<DayTrain>,
    client: Option<Process>,
    /// Counts of daemons that have ended.
    ended: TrainAccount,
    latencies_ns: Vec<u64>,
    /// Resident memory of this daemon in KiB by quarter.
    resident_kib: Vec<u64>,
    starts: u64,
}

/// Runs `hours` hours; every third of them has a daemon of its own, of which the first is killed.
///
/// # Panics
///
/// When memory grows, a sample is not accounted for, a state is not whole or is refused, a full disk is not
/// reported, or the daemon does not go on.
pub fn run(programs: &Programs, hours: usize, seed: u64) -> Vec<Hour> {
    let mut day = Day::new(programs, seed);
    let mut rows = vec![Hour::default(); hours];
    let quarters = 4 * hours;
    for quarter in 0..quarters {
        if quarter > 0 && 3 * quarter / quarters != 3 * (quarter - 1) / quarters {
            day.start_another(3 * quarter / quarters == 2);
        }
        day.quarter(quarter);
        let row = &mut rows[quarter / 4];
        row.resident_kib = row.resident_kib.max(day.resident_kib.last().copied().unwrap_or(0));
        if quarter % 4 == 3 {
            day.report(row);
        }
    }
    day.end();
    for hour in (1..hours).rev() {
        let before = rows[hour - 1].clone();
        let row = &mut rows[hour];
        (row.offered, row.starts) = (row.offered - before.offered, row.starts - before.starts);
        row.account = std::array::from_fn(|k| row.account[k] - before.account[k]);
    }
    rows
}

impl<'a> Day<'a> {
    fn new(programs: &'a Programs, seed: u64) -> Self {
        let site = DaemonSite::new();
        let states = site.path().join("states");
        std::fs::create_dir(&states).expect("a folder for the states");
        let host = site.host();
        let folder = |number: u64| site.path().join(number.to_string());
        let trains = (1..=TRAINS).map(|it| DayTrain::new(&host, it, seed, &folder(it))).collect();
        let (text, pipelines) = daemon_text(&states);
        let config = site.write("daemon.toml", &text);
        let strange = StrangeHost::new(site.path(), &states);
        let daemon = start(&site, programs, &config, &strange);
        let mut day = Day {
            site,
            programs,
            config,
            states,
            strange,
            daemon,
            pipelines,
            trains,
            client: None,
            ended: TrainAccount::default(),
            latencies_ns: Vec::new(),
            resident_kib: Vec::new(),
            starts: 1,
        };
        day.meet();
        day
    }

    fn meet(&mut self) {
        self.trains.iter_mut().for_each(|train| train.meet(self.pipelines, &self.daemon));
    }

    /// A quarter of an hour with its trouble.
    fn quarter(&mut self, quarter: usize) {
        let (hour, trouble) = (quarter / 4, TROUBLES[quarter % 4]);
        let start_ns = quarter as i64 * QUARTER_NS;
        let (half_ns, end_ns) = (start_ns + QUARTER_NS / 2, start_ns + QUARTER_NS);
        let (away, set_back) = (hour % self.trains.len(), (hour + 1) % self.trains.len());
        match trouble {
            Trouble::Client => {
                let peer = self.programs.peer.to_str().expect("a UTF-8 path");
                let next = self.site.start(peer, &["client", "3", "1000000"]);
                if let Some(before) = self.client.replace(next) {
                    before.kill();
                }
            }
            Trouble::FullDisk => self.strange.set_free(Some(100)),
            Trouble::Clock => {
                self.strange.set_clock_ahead(CLOCK_AHEAD_S[hour % CLOCK_AHEAD_S.len()]);
                self.trains[away].set_driven(false, start_ns);
            }
            Trouble::Standstill => {}
        }
        self.drive(half_ns);
        match trouble {
            Trouble::Standstill => self.stand_still(half_ns),
            Trouble::Clock => self.trains[set_back].set_back(SET_BACK_NS),
            _ => {}
        }
        self.drive(end_ns);
        self.account();
        if trouble == Trouble::FullDisk {
            self.daemon.await_error("state not kept");
        }
        self.whole_states();
        self.strange.set_free(None);
        self.trains[away].set_driven(true, end_ns);
        self.resident_kib.push(resident_kib(&self.daemon));
    }

    /// Feeds all trains up to a time of the day.
    fn drive(&mut self, end_ns: i64) {
        let mut is_driving = true;
        while is_driving {
            is_driving = false;
            for train in &mut self.trains {
                is_driving |= train.publish(BATCH, end_ns);
            }
            for train in &mut self.trains {
                train.follow(&self.daemon, &mut self.latencies_ns);
            }
        }
    }

    /// The daemon is stopped while more samples come than its buffers hold.
    fn stand_still(&mut self, now_ns: i64) {
        self.daemon.stop();
        for train in &mut self.trains {
            train.publish(FLOOD, now_ns + QUARTER_NS / 4);
        }
        self.daemon.signal(Signal::CONT);
        for train in &mut self.trains {
            train.follow(&self.daemon, &mut Vec::new());
        }
    }

    /// Every sample is accounted for by every pipeline; the fate of them since the day began.
    fn account(&mut self) -> TrainAccount {
        let mut all = self.ended;
        for train in &mut self.trains {
            let account = train.account(self.pipelines, &self.daemon);
            (0..all.len()).for_each(|k| all[k] += account[k]);
        }
        all
    }

    /// Every state on the disk is whole; gives how many there are.
    fn whole_states(&self) -> usize {
        let state = |train: u64| file::read(&path_of(&self.states, TrainId(train)));
        let states = (1..=TRAINS).map(|train| state(train).expect("a whole state"));
        states.flatten().count()
    }

    /// The daemon ends, and another comes.
    fn start_another(&mut self, is_last: bool) {
        self.ended = self.account();
        self.check_memory();
        await_true(|| self.whole_states() > 0, || "an estimate to be kept".into());
        self.daemon.signal(if is_last { Signal::TERM } else { Signal::KILL });
        self.daemon.wait();
        if is_last {
            self.strange.set_clock_ahead(FAR_AHEAD_S);
        }
        self.daemon = start(&self.site, self.programs, &self.config, &self.strange);
        self.starts += 1;
        self.meet();
        let said = self.daemon.errors();
        assert!(!said.contains("refused, cold start"), "{said}");
    }

    /// Memory settles in the first third of a daemon's life, and stays.
    fn check_memory(&mut self) {
        let by_quarter = std::mem::take(&mut self.resident_kib);
        let settled = by_quarter.get(by_quarter.len() / 3).copied().unwrap_or(0);
        let most = by_quarter.iter().copied().max().unwrap_or(0);
        assert!(most <= settled + GROWTH_MAX_KIB, "memory grows: {by_quarter:?} KiB");
    }

    /// The row of an hour that ends now; its counts are since the day began.
    fn report(&mut self, row: &mut Hour) {
        row.account = self.account();
        row.offered =
            self.pipelines as u64 * self.trains.iter().map(DayTrain::published).sum::<u64>();
        assert_eq!(row.account.iter().sum::<u64>(), row.offered, "{row:?}");
        let latencies_ns = std::mem::take(&mut self.latencies_ns);
        (row.latency_p50_ns, row.latency_p999_ns) = quantiles(latencies_ns);
        row.starts = self.starts;
        row.whole_states = self.whole_states();
    }

    fn end(mut self) {
        self.check_memory();
        assert!(self.daemon.end(Signal::TERM).success(), "{}", self.daemon.errors());
        assert!(self.whole_states() > 0, "no estimate was kept at the end");
    }
}

fn start(site: &DaemonSite, programs: &Programs, config: &Path, strange: &StrangeHost) -> Process {
    let text = |path: &Path| path.to_str().expect("a UTF-8 path").to_owned();
    let arguments = ["run", "--config", &text(config)];
    site.start_with(&text(&programs.dynocar), &arguments, &strange.variables())
}

/// Returns the shipped configuration for eight trains with states; and how many pipelines it has.
fn daemon_text(states: &Path) -> (String, usize) {
    let mut config: toml::Table = SHIPPED.parse().expect("the shipped configuration");
    let pipelines = config["pipelines"].as_array().map_or(0, Vec::len);
    let own = format!(
        "[daemon]\nlog = \"warn\"\n[state]\ndirectory = {:?}\ninterval_s = 1\n",
        states.to_str().expect("a UTF-8 path")
    );
    let train = |id: u64| {
        format!("[[trains]]\nid = {id}\nfile = \"{id}/train.toml\"\ntrack = \"{id}/track.toml\"\n")
    };
    let own = own + &(1..=TRAINS).map(train).collect::<String>();
    config.extend(own.parse::<toml::Table>().expect("what is added to it"));
    (toml::to_string(&config).expect("a configuration"), pipelines)
}
