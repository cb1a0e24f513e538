//! A simulated dataset as a folder of files.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use dynocar_analysis::dataset::Dataset;
use dynocar_model::train::TrainModel;

use super::columns::{FileStyle, make_style, row_text};
use super::random::{SimulatorRandom, Stream};
use super::{SimulatedDataset, SimulatedRun, gnss};

/// A file of a dataset: its path within the folder, and its text.
pub type FileText = (String, String);

/// Entries of `[columns]` for the columns of a GNSS receiver.
const GNSS_COLUMNS: &str = "latitude = { column = \"lat\", unit = \"deg\" }\n\
    longitude = { column = \"lon\", unit = \"deg\" }\n\
    altitude = { column = \"alt\", unit = \"m\" }";

/// Returns the files of a dataset; nothing in them reveals the truth.
pub fn dataset_files(dataset: &SimulatedDataset) -> Vec<FileText> {
    let settings = &dataset.settings;
    let extra_decimals = if settings.sensor_noise == 0.0 { 4 } else { 0 };
    let style = make_style(extra_decimals, &mut SimulatorRandom::new(settings.seed, Stream::Files));
    let mut files = vec![
        ("dataset.toml".to_string(), dataset_toml(dataset, &style)),
        ("train.toml".to_string(), train_toml(dataset.declared_train())),
    ];
    if settings.gnss.is_none() {
        files.push(("track.toml".to_string(), track_toml(dataset)));
    }
    files.extend(
        dataset
            .runs
            .iter()
            .map(|run| (run.plan.file(), run_csv(run, &style, dataset.declared_train().length_m))),
    );
    files
}

/// Reads a simulated dataset's files as the program does.
///
/// # Panics
///
/// When one is refused.
pub fn read_files(files: &[FileText]) -> Dataset {
    let texts: Vec<(&str, &str)> =
        files.iter().map(|(path, text)| (path.as_str(), text.as_str())).collect();
    Dataset::load(&texts[..]).expect("a simulated dataset")
}

/// Writes a dataset into a folder, which is made if it does not exist.
///
/// # Errors
///
/// When a file cannot be written.
pub fn write_dataset(dataset: &SimulatedDataset, folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder.join("runs"))?;
    for (path, text) in dataset_files(dataset) {
        fs::write(folder.join(path), text)?;
    }
    Ok(())
}

/// Writes a dataset's truth as JSON.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write_truth(dataset: &SimulatedDataset, file: &Path) -> io::Result<()> {
    fs::write(file, format!("{:#}\n", dataset.truth_json()))
}

fn dataset_toml(dataset: &SimulatedDataset, style: &FileStyle) -> String {
    let mut text = String::new();
    let reference = if style.is_head_position { "head" } else { "centre" };
    let mut line = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    line("[dataset]".into());
    line(format!("name = \"simulated-{}\"", dataset.settings.seed));
    line(format!(
        "description = \"Simulated: {}, {}\"",
        dataset.declared_train().name,
        dataset.track().name
    ));
    line(format!("position_reference = \"{reference}\""));
    if style.delimiter != ',' {
        line(format!("delimiter = \"{}\"", style.delimiter));
    }
    line("\n[train]\nfile = \"train.toml\"\n".into());
    if dataset.settings.gnss.is_none() {
        line("[track]\nfile = \"track.toml\"\n".into());
    }
    line("[columns]".into());
    if dataset.settings.gnss.is_some() {
        line(GNSS_COLUMNS.into());
    }
    let has_odometer = dataset.settings.gnss.is_none();
    for column in style.columns.iter().filter(|it| it.is_written(has_odometer)) {
        let scale = match column.scale {
            1.0 => String::new(),
            scale => format!(", scale = {scale}"),
        };
        line(format!(
            "{} = {{ column = \"{}\", unit = \"{}\"{scale} }}",
            column.quantity.canonical(),
            column.name,
            column.unit
        ));
    }
    for run in &dataset.runs {
        let role = if run.plan.is_holdout { "holdout" } else { "fit" };
        line(format!("\n[[runs]]\nfile = \"{}\"\nrole = \"{role}\"", run.plan.file()));
        line(format!("direction = {:.0}", run.plan.direction));
        line(format!("mass_t = {:.1}", run.plan.declared_mass_kg() / 1000.0));
    }
    text
}

fn train_toml(train: &TrainModel) -> String {
    let effort_kn = |points: &[(f64, f64)]| {
        let points: Vec<String> =
            points.iter().map(|(v, f)| format!("[{v:.2}, {:.1}]", f / 1000.0)).collect();
        points.join(", ")
    };
    let traction = train.traction.as_ref().map_or(String::new(), |effort| {
        format!("\n[traction]\neffort = [{}]\n", effort_kn(effort.points()))
    });
    let brake = train.brake.as_ref().map_or(String::new(), |effort| {
        format!("\n[brake]\nmax_force_kn = {:.1}\n", effort.force_max_n() / 1000.0)
    });
    format!(
        "[train]\nname = \"{}\"\nmass_t = {:.1}\nlength_m = {:.1}\ncars = {}\n\
         rotating_mass_factor = {:?}\n\n[resistance]\na = {:?}\nb = {:?}\nc = {:?}\n{traction}{brake}",
        train.name,
        train.mass_kg / 1000.0,
        train.length_m,
        train.cars,
        train.rotating_mass_factor,
        train.resistance.a,
        train.resistance.b,
        train.resistance.c,
    )
}

fn track_toml(dataset: &SimulatedDataset) -> String {
    let track = dataset.track();
    let mut text = format!(
        "[track]\nname = \"{}\"\nlength_m = {:.1}\ngradient = [\n",
        track.name, dataset.line.length_m
    );
    if let Some(gradient) = track.gradient() {
        for (chainage_m, permille) in gradient.entries() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  [{chainage_m:.1}, {permille:.1}],");
        }
    }
    text.push_str("]\ncurves = [\n");
    for curve in track.curves() {
        let _ =
            writeln!(text, "  [{:.1}, {:.1}, {:.1}],", curve.start_m, curve.end_m, curve.radius_m);
    }
    text.push_str("]\ntunnels = [\n");
    let mapped = track.tunnels().iter().filter(|_| dataset.settings.maps_tunnels);
    for tunnel in mapped {
        let _ = writeln!(text, "  [{:.1}, {:.1}],", tunnel.start_m, tunnel.end_m);
    }
    text.push_str("]\n");
    text
}

fn run_csv(run: &SimulatedRun, style: &FileStyle, train_length_m: f64) -> String {
    let number = style.has_row_numbers.then_some("row");
    let has_odometer = run.positions.is_empty();
    let written = style.columns.iter().filter(|it| it.is_written(has_odometer));
    let names = written.map(|column| column.name.as_str());
    let mut text = String::with_capacity(64 * run.samples.len());
    let delimiter = style.delimiter.to_string();
    let gnss = if has_odometer { &[][..] } else { &["lat", "lon", "alt"][..] };
    let names = number.into_iter().chain(names).chain(gnss.iter().copied());
    text.push_str(&names.collect::<Vec<_>>().join(&delimiter));
    text.push('\n');
    for (k, sample) in run.samples.iter().enumerate() {
        text.push_str(&row_text(sample, style, &run.plan, train_length_m, k + 1, has_odometer));
        if let Some(position) = run.positions.get(k) {
            text.push_str(&gnss::row_text(position.as_ref(), &delimiter));
        }
        text.push('\n');
    }
    text
}
