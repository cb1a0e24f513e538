//! Recorded stops of a suburban train: speeds in steps of 1 km/h once a second, a pause while the train stands, and
//! drivers who ease the brake at the platform.

use std::fmt::Write as _;

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::stops::{FindSettings, FoundBy, Manner, Study, StudySettings};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

const TRAIN: &str = "[train]\nmass_t = 240\nlength_m = 104\nrotating_mass_factor = 0.08\n\
    [resistance]\na = 1.5\nb = 0.02\nc = 0.0008\n[brake]\nmax_force_kn = 200\n";
const STEP_S: f64 = 0.02;
/// Speed in m/s at which a driver eases the brake at the platform.
const PLATFORM_MPS: f64 = 1.7;
/// Time constant in s of the brake.
const BRAKE_S: f64 = 0.8;

/// True values of one stop.
struct True {
    applied_s: f64,
    from_mps: f64,
    distance_m: f64,
    time_s: f64,
    is_full: bool,
    /// (speed in m/s, deceleration in m/s²), from fast to slow.
    decelerations: Vec<(f64, f64)>,
}

/// A driver's wish in m/s² at a speed.
struct Driver {
    first_mps2: f64,
    second_mps2: f64,
    eases_mps: f64,
    is_full: bool,
}

impl Driver {
    fn draw(is_full: bool, random: &mut StdRng) -> Self {
        let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        Driver {
            first_mps2: if is_full { 1.2 } else { uniform(0.7, 1.0) },
            second_mps2: uniform(0.35, 0.5),
            eases_mps: uniform(6.0, 9.0),
            is_full,
        }
    }

    fn wants_mps2(&self, speed_mps: f64) -> f64 {
        match (self.is_full, speed_mps) {
            (true, _) => self.first_mps2,
            (false, fast) if fast > self.eases_mps => self.first_mps2,
            (false, fast) if fast > PLATFORM_MPS => self.second_mps2,
            (false, _) => 0.25,
        }
    }
}

/// Writes a row each second, and none while the train stands.
struct Recorder {
    text: String,
    next_s: f64,
}

impl Recorder {
    fn take(&mut self, time_s: f64, speed_mps: f64, wanted_mps2: f64) {
        if time_s >= self.next_s {
            let (kmh, share) = ((3.6 * speed_mps).round(), wanted_mps2 / 1.2);
            writeln!(self.text, "{time_s:.2},{kmh},{share:.3}").unwrap();
            self.next_s = time_s.floor() + 1.0;
        }
    }
}

/// A trip of some stops: its recording (time, speed in km/h, brake in shares of its effort) and the truth.
fn trip(stops: usize, random: &mut StdRng) -> (String, Vec<True>) {
    let mut recorder = Recorder { text: "t,v,b\n".into(), next_s: 0.0 };
    let (mut truth, mut time_s) = (Vec::new(), 0.0);
    for k in 0..stops {
        let driver = Driver::draw(k % 6 == 0, random);
        let cruise_mps = 13.0 + 12.0 * random.random::<f64>();
        let mut speed_mps: f64 = 0.0;
        while speed_mps < cruise_mps {
            recorder.take(time_s, speed_mps, 0.0);
            speed_mps += STEP_S * 0.7;
            time_s += STEP_S;
        }
        for _ in 0..1500 {
            recorder.take(time_s, speed_mps, 0.0);
            speed_mps -= STEP_S * 0.02;
            time_s += STEP_S;
        }
        let (applied_s, from_mps) = (time_s, speed_mps);
        let (mut acting_mps2, mut distance_m, mut decelerations) = (0.02, 0.0, Vec::new());
        while speed_mps > 0.0 {
            let wanted_mps2 = driver.wants_mps2(speed_mps);
            recorder.take(time_s, speed_mps, wanted_mps2);
            acting_mps2 += STEP_S / BRAKE_S * (wanted_mps2 - acting_mps2);
            decelerations.push((speed_mps, acting_mps2));
            distance_m += STEP_S * speed_mps;
            speed_mps -= STEP_S * acting_mps2;
            time_s += STEP_S;
        }
        let (is_full, stopped_s) = (driver.is_full, time_s - applied_s);
        truth.push(True {
            applied_s,
            from_mps,
            distance_m,
            time_s: stopped_s,
            is_full,
            decelerations,
        });
        // The first 0 is written; then the recorder sleeps until the train moves again.
        recorder.take(recorder.next_s, 0.0, 0.3);
        time_s = recorder.next_s + 20.0 + 280.0 * random.random::<f64>();
    }
    (recorder.text, truth)
}

fn study(recording: &str, columns: &str) -> Study {
    let manifest = format!(
        "[dataset]\nname = \"stops\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
         time = {{ column = \"t\", unit = \"s\" }}\n\
         speed = {{ column = \"v\", unit = \"km/h\" }}\n{columns}[[runs]]\nfile = \"run.csv\"\n"
    );
    let files = [("dataset.toml", &manifest[..]), ("train.toml", TRAIN), ("run.csv", recording)];
    let dataset = Dataset::load(&files[..]).expect("a dataset");
    let settings = StudySettings { find: FindSettings::default(), repeatability: 0.03 };
    Study::new(&dataset, &settings, &[])
}

/// Checks that every stop is found with its manner, time and distance; returns how many decelerations lie in their
/// intervals, and the number of all.
fn compare(study: &Study, truth: &[True], found_by: FoundBy) -> [usize; 2] {
    assert_eq!(study.stops.len(), truth.len());
    let (mut inside, mut looks) = (0, 0);
    for (stop, truth) in study.stops.iter().zip(truth) {
        let manner = if truth.is_full { Manner::Full } else { Manner::Modulated };
        assert_eq!((stop.manner, stop.found_by), (manner, found_by), "{stop:?}");
        assert_eq!(stop.no_law.is_none(), truth.is_full, "{stop:?}");
        // Without its record, the brake is seen once the speed has fallen.
        let late_s = stop.from_s - truth.applied_s;
        assert!(late_s.abs() < 3.1, "{late_s} s: {stop:?}");
        let missed_m = late_s * truth.from_mps;
        let off_m = stop.distance_m - (truth.distance_m - missed_m);
        assert!(off_m.abs() < 0.04 * truth.distance_m, "{off_m} of {} m", truth.distance_m);
        // The last km/h counts as standing already, and there is a row each second.
        assert!((stop.time_s - (truth.time_s - late_s)).abs() < 2.7, "{stop:?}");
        for it in &stop.decelerations {
            let at = truth.decelerations.iter().rev().find(|(mps, _)| *mps >= it.speed_mps);
            let Some((_, true_mps2)) = at else { continue };
            looks += 1;
            inside += usize::from((it.deceleration_mps2 - true_mps2).abs() <= 1.96 * it.std_mps2);
        }
    }
    [inside, looks]
}

#[test]
fn stops_of_a_coarse_recorder_are_found_and_those_of_the_driver_show_no_law() {
    let (mut inside, mut looks) = (0, 0);
    for seed in 0..6 {
        let (recording, truth) = trip(18, &mut StdRng::seed_from_u64(seed));
        let recorded = "brake_handle = { column = \"b\", unit = \"1\" }\n";
        for (columns, found_by) in [(recorded, FoundBy::Brake), ("", FoundBy::Speed)] {
            let study = study(&recording, columns);
            let [within, of] = compare(&study, &truth, found_by);
            (inside, looks) = (inside + within, looks + of);
            let law = study.law.as_ref().expect("three stops by all of the brake");
            assert_eq!(law.stops, 3);
            let fast = law.points.iter().filter(|it| it.speed_mps > 4.0);
            for point in fast {
                assert!((point.deceleration_mps2 - 1.2).abs() < 0.15, "{point:?}");
            }
            let said = "the law of the brake in 15 of 18 stops";
            assert!(study.cannot_tell.iter().any(|it| it.starts_with(said)), "{study:?}");
        }
    }
    let share = inside as f64 / looks as f64;
    println!("{share:.3} of {looks} decelerations lie in their intervals");
    assert!(share > 0.85, "{share}");
}

#[test]
fn a_trip_of_modulated_stops_alone_has_stops_and_no_law() {
    let (recording, truth) = trip(6, &mut StdRng::seed_from_u64(40));
    let second = truth[1].applied_s - 40.0;
    let later = recording.lines().skip(1).filter(|row| {
        let (time_s, _) = row.split_once(',').unwrap();
        time_s.parse::<f64>().unwrap() > second
    });
    let rows: Vec<&str> = ["t,v,b"].into_iter().chain(later).collect();
    let study = study(&rows.join("\n"), "");
    assert_eq!((study.stops.len(), study.law.is_none()), (5, true));
    for stop in &study.stops {
        let why = stop.no_law.as_deref().unwrap();
        assert!(why.contains("eased"), "{why}");
        assert!(stop.decelerations.len() > 5 && stop.distance_m > 50.0);
    }
}
