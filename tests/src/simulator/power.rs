//! A simulated dataset recorded by a drive that reports its power and no force.

use std::fmt::Write as _;

use dynocar_shared::SampleField;

use super::dataset_writer::{FileText, dataset_files};
use super::random::{SimulatorRandom, Stream};
use super::true_run::TRUE_STEP_S;
use super::{SimulatedDataset, SimulatedRun};

/// A drive and the power that its recorder reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueDrive {
    /// Share of the electric power that reaches the rims, and of the rims' power that comes back.
    pub efficiency: f64,
    /// Power in W that the line feeds in addition to the drive; `None` for a recorder of the drive's own
    /// power.
    pub auxiliary_power_w: Option<f64>,
    /// Standard deviation of the recorded power as a share of it.
    pub noise: f64,
}

impl TrueDrive {
    /// Electric power in W for a force in N at the rims.
    fn electric_w(&self, force_n: f64, speed_mps: f64) -> f64 {
        let mechanical_w = force_n * speed_mps;
        let drive_w = match mechanical_w > 0.0 {
            true => mechanical_w / self.efficiency,
            false => mechanical_w * self.efficiency,
        };
        drive_w + self.auxiliary_power_w.unwrap_or(0.0)
    }

    fn quantity(&self) -> &'static str {
        if self.auxiliary_power_w.is_some() { "line_power" } else { "traction_power" }
    }
}

/// Returns the files of a dataset of which power is recorded in place of forces: every brake feeds back.
pub fn power_files(dataset: &SimulatedDataset, drive: &TrueDrive) -> Vec<FileText> {
    let mut random = SimulatorRandom::new(dataset.settings.seed, Stream::Files);
    let mut manifest = format!(
        "[dataset]\nname = \"power-{}\"\n[train]\nfile = \"train.toml\"\n[track]\nfile = \
         \"track.toml\"\n[columns]\ntime = {{ column = \"t\", unit = \"s\" }}\nposition = {{ column = \
         \"s\", unit = \"m\" }}\nspeed = {{ column = \"v\", unit = \"m/s\" }}\n{} = {{ column = \"P\", \
         unit = \"W\" }}\n",
        dataset.settings.seed,
        drive.quantity()
    );
    let declared = dataset_files(dataset);
    let mut files: Vec<FileText> = declared
        .into_iter()
        .filter(|(name, _)| matches!(&name[..], "train.toml" | "track.toml"))
        .collect();
    for run in &dataset.runs {
        let role = if run.plan.is_holdout { "holdout" } else { "fit" };
        // Writing to a string cannot fail.
        let _ = write!(
            manifest,
            "[[runs]]\nfile = \"{}\"\nrole = \"{role}\"\ndirection = {:.0}\nmass_t = {:.1}\n",
            run.plan.file(),
            run.plan.direction,
            run.plan.declared_mass_kg() / 1000.0
        );
        files.push((run.plan.file(), run_csv(run, drive, &mut random)));
    }
    files.push(("dataset.toml".into(), manifest));
    files
}

fn run_csv(run: &SimulatedRun, drive: &TrueDrive, random: &mut SimulatorRandom) -> String {
    let mut text = String::from("t,s,v,P\n");
    let first_ns = run.samples.first().map_or(0, |sample| sample.time_ns);
    for sample in &run.samples {
        let since_s = (sample.time_ns - first_ns) as f64 * 1e-9;
        let at = ((since_s / TRUE_STEP_S).round() as usize).min(run.states.len() - 1);
        let state = &run.states[at];
        let force_n = state.acting.traction_force_n - state.acting.brake_force_n;
        let power_w = drive.electric_w(force_n, state.speed_mps);
        let power_w = power_w * (1.0 + drive.noise * random.gaussian());
        let position_m = sample.get(SampleField::Position).unwrap_or(f64::NAN);
        let _ = writeln!(
            text,
            "{:.3},{position_m:.2},{:.4},{power_w:.0}",
            sample.time_ns as f64 * 1e-9,
            sample.speed_mps
        );
    }
    text
}
