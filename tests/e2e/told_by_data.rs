//! An answer states everything that the data do not determine: coefficients of the resistance, effects, and effects
//! that look alike.

use std::fmt::Write as _;
use std::path::Path;

use dynocar::dataset::load;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_tests::simulator::random::{SimulatorRandom, Stream};

const MASS_T: f64 = 100.0;
const MANIFEST: &str = "[dataset]\nname = \"steady\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
    time = { column = \"time_s\", unit = \"s\" }\n\
    speed = { column = \"speed_mps\", unit = \"m/s\" }\n\
    traction_force = { column = \"traction_n\", unit = \"N\" }\n\
    brake_force = { column = \"brake_n\", unit = \"N\" }\n\
    gradient = { column = \"gradient_permille\", unit = \"permille\" }\n";
const TRAIN: &str = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.06\n\
    [resistance]\na = 1.5\nb = 0.02\nc = 0.0008\n";

/// Explains runs on level track at the given speeds in m/s, five minutes at each, with noise on speed and force.
fn explained(folder: &Path, speeds_mps: &[f64]) -> Explanation {
    let mut manifest = String::from(MANIFEST);
    for run in 0..3_u64 {
        let mut random = SimulatorRandom::new(run, Stream::Sensors(run as usize));
        let name = format!("run{run}.csv");
        let mut rows = String::from("time_s,speed_mps,traction_n,brake_n,gradient_permille\n");
        let (mut speed_mps, mut time_s) = (speeds_mps[0], 0.0);
        for &wanted_mps in speeds_mps {
            for _ in 0..600 {
                let w0 = 1.5 + speed_mps * (0.02 + 0.0008 * speed_mps);
                let acceleration = (0.5 * (wanted_mps - speed_mps)).clamp(-0.3, 0.3);
                let force_n = 1e3 * MASS_T * (1.06 * acceleration + 9.80665e-3 * w0);
                let shown_mps = speed_mps + 0.02 * random.gaussian();
                let shown_n = force_n.abs() + 100.0 * random.gaussian();
                let (traction, brake) =
                    if force_n > 0.0 { (shown_n.max(0.0), 0.0) } else { (0.0, shown_n.max(0.0)) };
                writeln!(rows, "{time_s:.1},{shown_mps:.3},{traction:.0},{brake:.0},0").unwrap();
                speed_mps += 0.5 * acceleration;
                time_s += 0.5;
            }
        }
        std::fs::write(folder.join(&name), rows).unwrap();
        writeln!(manifest, "[[runs]]\nfile = \"{name}\"\nrole = \"fit\"").unwrap();
    }
    std::fs::write(folder.join("dataset.toml"), manifest).unwrap();
    std::fs::write(folder.join("train.toml"), TRAIN).unwrap();
    explain(&load(folder).unwrap(), &|_, _| {}).unwrap()
}

#[test]
fn one_speed_does_not_show_a_b_and_c_apart_and_several_do() {
    let folder = tempfile::tempdir().unwrap();
    let steady = explained(folder.path(), &[19.0]).answer;
    assert!(steady.effects.is_empty(), "{}", steady.statement);
    assert!(steady.statement.contains("hardly determine"), "{}", steady.statement);
    let by_data = steady.base.told_by_data;
    assert!(by_data.b < 0.3 && by_data.c < 0.5, "{by_data:?}");
    let folder = tempfile::tempdir().unwrap();
    let varied = explained(folder.path(), &[5.0, 12.0, 20.0, 28.0, 9.0]).answer;
    assert!(!varied.statement.contains("hardly determine"), "{}", varied.statement);
    let by_data = varied.base.told_by_data;
    assert!([by_data.a, by_data.b, by_data.c].iter().all(|share| *share > 0.5), "{by_data:?}");
}

#[test]
fn steady_runs_hide_a_rotating_mass_and_level_ones_hold_it_for_a_mass() {
    let folder = tempfile::tempdir().unwrap();
    let steady = explained(folder.path(), &[19.0]).answer;
    let of = |answer: &dynocar_analysis::explain::answer::ExplainAnswer, kind: &str| {
        answer.identifiability.iter().find(|own| own.kind == kind).cloned()
    };
    let hidden = of(&steady, "rotating_mass").expect("it can be tested");
    assert!(!hidden.told && hidden.std.is_none_or(|std| std > 0.01), "{hidden:?}");
    assert!(steady.statement.contains("Not to be judged from these runs"), "{}", steady.statement);
    let folder = tempfile::tempdir().unwrap();
    let level = explained(folder.path(), &[5.0, 20.0, 8.0, 28.0, 4.0, 24.0, 9.0]).answer;
    let rotating_mass = of(&level, "rotating_mass").expect("it can be tested");
    assert!(
        rotating_mass.told && rotating_mass.std.is_some_and(|std| std < 0.01),
        "{rotating_mass:?}"
    );
    assert!(rotating_mass.alike.contains(&"mass_change"), "{rotating_mass:?}");
    assert!(level.statement.contains("look alike"), "{}", level.statement);
}
