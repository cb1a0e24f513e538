//! Recorded days of a suburban train: whole km/h every second or every two seconds, pauses while the train stands,
//! brakes eased and applied again, creeping, restrictions and runs that end in motion.

use std::fmt::Write as _;

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::stops::{FindSettings, Study, StudySettings};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

const TRAIN: &str = "[train]\nmass_t = 240\nlength_m = 104\nrotating_mass_factor = 0.08\n\
    [resistance]\na = 1.5\nb = 0.02\nc = 0.0008\n";
const STEP_S: f64 = 0.05;

/// True values of a stop.
struct True {
    from_s: f64,
    stands_s: f64,
    distance_m: f64,
}

/// A train with its recorder.
struct Day {
    random: StdRng,
    interval_s: f64,
    text: String,
    next_s: f64,
    time_s: f64,
    speed_mps: f64,
    distance_m: f64,
    /// The recorder is switched off until then.
    silent_until_s: f64,
}

impl Day {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.random::<f64>()
    }

    fn happens(&mut self, share: f64) -> bool {
        self.random.random::<f64>() < share
    }

    fn step(&mut self, acceleration_mps2: f64) {
        if self.time_s >= self.next_s {
            if self.time_s >= self.silent_until_s {
                writeln!(self.text, "{:.2},{}", self.time_s, (3.6 * self.speed_mps).round())
                    .unwrap();
            }
            self.next_s += self.interval_s;
        }
        self.speed_mps = (self.speed_mps + STEP_S * acceleration_mps2).max(0.0);
        self.distance_m += STEP_S * self.speed_mps;
        self.time_s += STEP_S;
    }

    fn reach(&mut self, to_mps: f64, rate_mps2: f64) {
        let sign = (to_mps - self.speed_mps).signum();
        while sign * (to_mps - self.speed_mps) > 0.0 {
            self.step(sign * rate_mps2);
        }
    }

    fn hold(&mut self, for_s: f64, drift_mps2: f64) {
        for _ in 0..(for_s / STEP_S) as usize {
            self.step(drift_mps2);
        }
    }

    /// A train that runs, at most slows down for a restriction, and may be lost by the recorder for a while.
    fn run(&mut self) {
        let cruise_mps = self.uniform(9.0, 31.0);
        self.reach(cruise_mps, 0.7);
        let for_s = self.uniform(20.0, 60.0);
        self.hold(for_s, -0.02);
        if self.happens(0.2) {
            self.silent_until_s = self.time_s + self.uniform(6.0, 25.0);
            self.hold(30.0, 0.0);
        }
        if self.happens(0.4) {
            let to_mps = self.speed_mps * self.uniform(0.4, 0.7);
            self.reach(to_mps.max(4.0), 0.6);
            let for_s = self.uniform(25.0, 60.0);
            self.hold(for_s, 0.0);
            if self.happens(0.6) {
                self.reach(cruise_mps, 0.5);
                self.hold(20.0, -0.02);
            }
        }
        // A speed restriction may be slower than the speed below which a stop is assumed.
        if self.speed_mps < 6.5 {
            self.reach(9.0, 0.5);
            self.hold(20.0, 0.0);
        }
    }

    /// Brakes to a stand as a driver does: in one to three applications, creeping at the end.
    fn stop(&mut self) -> True {
        if self.happens(0.2) {
            // It rolls along the platform first.
            self.reach(4.0, 0.7);
            let (for_s, drift) = (self.uniform(17.0, 40.0), 0.0);
            self.hold(for_s, drift);
        }
        let (from_s, from_m, from_mps) = (self.time_s, self.distance_m, self.speed_mps);
        let applications = self.random.random_range(1..=3);
        for k in 1..if from_mps > 5.0 { applications } else { 1 } {
            let share = 1.0 - f64::from(k) / f64::from(applications);
            let rate = self.uniform(0.5, 1.1);
            self.reach((from_mps * share).max(3.0), rate);
            let (for_s, drift) = (self.uniform(1.0, 6.0), self.uniform(-0.15, 0.02));
            self.hold(for_s, drift);
        }
        let rate = self.uniform(0.5, 1.1);
        self.reach(6.4 / 3.6, rate);
        if self.happens(0.2) {
            let for_s = self.uniform(3.0, 15.0);
            self.hold(for_s, 0.0);
        }
        self.hold(3.0, -0.1);
        self.reach(0.0, 0.28);
        True { from_s, stands_s: self.time_s, distance_m: self.distance_m - from_m }
    }

    /// The recorder writes one row of 0, or none, and sleeps until the train moves.
    fn stand(&mut self) {
        let (zero_s, for_s) = (self.next_s, self.uniform(20.0, 200.0));
        if self.happens(0.9) {
            writeln!(self.text, "{zero_s:.2},0").unwrap();
        }
        self.time_s = zero_s + for_s;
        self.next_s = self.time_s + self.interval_s;
    }
}

/// A day of some stops: its recording and the stops as they were.
fn day(seed: u64, interval_s: f64, stops: usize) -> (String, Vec<True>) {
    let mut day = Day {
        random: StdRng::seed_from_u64(seed),
        interval_s,
        text: "t,v\n".into(),
        next_s: 0.0,
        time_s: 0.0,
        speed_mps: 0.0,
        distance_m: 0.0,
        silent_until_s: 0.0,
    };
    let mut truth = Vec::new();
    for _ in 0..stops {
        day.run();
        truth.push(day.stop());
        day.stand();
        if day.happens(0.2) {
            // A move to the mark is no stop.
            day.reach(2.0, 0.3);
            day.hold(6.0, 0.0);
            day.reach(0.0, 0.3);
            day.stand();
        }
    }
    day.run();
    (day.text, truth)
}

fn study(recording: &str) -> (Dataset, Study) {
    let manifest = "[dataset]\nname = \"day\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
         time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"km/h\" }\n\
         [[runs]]\nfile = \"run.csv\"\n";
    let files = [("dataset.toml", manifest), ("train.toml", TRAIN), ("run.csv", recording)];
    let dataset = Dataset::load(&files[..]).expect("a dataset");
    let settings = StudySettings { find: FindSettings::default(), repeatability: 0.03 };
    let study = Study::new(&dataset, &settings, &[]);
    (dataset, study)
}

#[test]
fn stops_of_whole_days_are_found_with_their_beginning_and_nothing_else_is() {
    for interval_s in [1.0, 2.0] {
        let (mut stops, mut found, mut false_ones) = (0, 0, 0);
        let (mut late_s, mut off): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for seed in 0..20 {
            let (recording, truth) = day(seed, interval_s, 30);
            let (dataset, study) = study(&recording);
            let said = dataset.diagnostics();
            assert!(said.iter().all(|it| it.code != "stands_still"), "{said:?}");
            let is = |stop: &&dynocar_analysis::stops::RecordedStop, truth: &True| {
                (stop.from_s + stop.time_s - truth.stands_s).abs() < 6.0
            };
            stops += truth.len();
            for truth in &truth {
                let Some(stop) = study.stops.iter().find(|it| is(it, truth)) else { continue };
                found += 1;
                late_s.push(stop.from_s - truth.from_s);
                off.push(stop.distance_m / truth.distance_m - 1.0);
            }
            let none = study.stops.iter().filter(|it| !truth.iter().any(|truth| is(it, truth)));
            false_ones += none.count();
            let day = &study.day;
            assert_eq!(day.from_speeds.iter().map(|it| it.stops).sum::<usize>(), study.stops.len());
            let dwell_s = day.dwell_s.expect("trains stand");
            assert!((20.0..80.0).contains(&dwell_s.low), "{dwell_s:?}");
        }
        let share = |values: &[f64], most: f64| {
            values.iter().filter(|it| it.abs() <= most).count() as f64 / values.len() as f64
        };
        let (early, near) = (share(&late_s, 2.0 + interval_s), share(&off, 0.1));
        println!(
            "every {interval_s} s: {found} of {stops} found, {false_ones} false; begin within {} s \
             in {early:.3}, distance within 10 % in {near:.3}",
            2.0 + interval_s
        );
        assert!(found as f64 >= 0.98 * stops as f64, "{found} of {stops}");
        assert!(f64::from(u32::try_from(false_ones).unwrap()) <= 0.01 * stops as f64);
        assert!(early > 0.95 && near > 0.85, "{early} {near}");
    }
}
