//! Facts and notes on a recorded run, wherever it is listed.

use dynocar::cli::text::{WIDTH, wrap};
use dynocar::models::UtcSecond;
use dynocar_analysis::dataset::{
    Dataset, DatasetDiagnostic, ForceSource, GradientSource, PositionSource, Run,
};
use dynocar_core::plausibility::Severity;

/// Returns a run's mass in t: the declared one, or the mean of the masses in its samples, with their range where they
/// differ.
pub fn mass_t(run: &Run) -> String {
    let Some(spread) = run.quality.mass_kg else { return tonnes(run.mass_kg) };
    let [mean, low, high] = [spread.mean, spread.low, spread.high].map(tonnes);
    if low == high { mean } else { format!("{mean} ({low}–{high})") }
}

/// Returns a mass in t: to the kilogram for a light vehicle, else to 100 kg.
pub fn tonnes(mass_kg: f64) -> String {
    let decimals = if mass_kg < 10e3 { 3 } else { 1 };
    format!("{:.decimals$}", mass_kg / 1000.0)
}

/// Returns the time at which a run was recorded, where it is known.
pub fn recorded(run: &Run) -> Option<UtcSecond> {
    let unix_s = run.recorded_unix_s?.try_into().ok()?;
    Some(UtcSecond { unix_s })
}

/// Returns the same in words, as people write it.
pub fn recorded_in_words(run: &Run) -> String {
    recorded(run).map_or_else(|| "–".into(), |at| at.to_string().replace('T', " ").replace('Z', ""))
}

/// Returns where a run's position, gradient, traction force and brake force come from, in words.
pub fn sources(run: &Run) -> [&'static str; 4] {
    let position = match run.position_source {
        PositionSource::Column => "as recorded",
        PositionSource::IntegratedSpeed => "integrated from the speed",
    };
    let gradient = match run.gradient_source {
        GradientSource::Track => "from the track",
        GradientSource::Column => "as recorded",
        GradientSource::SpecificForce => "from the accelerometer: specific_force minus dv/dt",
        GradientSource::Altitude => "from the altitude",
        GradientSource::Unknown => "unknown, taken as level",
    };
    let force = |source: ForceSource| match source {
        ForceSource::Column => "as recorded",
        ForceSource::ControlForce => "from the signed control_force",
        ForceSource::Handle => "from the handle's share of the effort curve",
        ForceSource::Pressure => "from the friction brake's pressure",
        ForceSource::Power => "from the drive's power over the speed",
        ForceSource::None => "not recorded",
    };
    [position, gradient, force(run.traction_source), force(run.brake_source)]
}

/// Times in s from 2000 to 2100 count from 1970; recordings with another origin are shorter.
const OF_EPOCH_S: std::ops::Range<f64> = 946_684_800.0..4_102_444_800.0;

/// Returns the second in UTC of a time in s that counts from 1970; `None` for one that counts from elsewhere.
pub fn moment(time_s: f64) -> Option<UtcSecond> {
    OF_EPOCH_S.contains(&time_s).then_some(UtcSecond { unix_s: time_s as u64 })
}

/// Returns the second from which a run's times are counted on an axis, and its time in s in the recording: that of the
/// first value where times count from 1970, else that of the first row where day and hour are known.
pub fn beginning(first_s: f64, run: Option<&Run>) -> Option<(UtcSecond, f64)> {
    let of_times = moment(first_s).map(|it| (it, first_s.floor()));
    of_times.or_else(|| {
        let run = run?;
        // A day alone is its midnight.
        let at = recorded(run).filter(|it| it.unix_s % 86_400 != 0)?;
        Some((at, run.quality.start_s))
    })
}

/// Notes on a dataset, each from a line of its own; those by which it cannot be true say so.
pub fn diagnostics(diagnostics: &[DatasetDiagnostic]) -> String {
    let line = |it: &DatasetDiagnostic| format!("{}\n", wrap(&it.labelled(), WIDTH).join("\n  "));
    diagnostics.iter().map(line).collect()
}

/// Returns why a dataset cannot be true as described, for a result that would rest on it; `None` where it may be.
pub fn impossible(dataset: &Dataset) -> Option<String> {
    let notes = dataset.diagnostics();
    let why = notes.iter().find(|it| it.severity == Severity::Fundamental)?;
    Some(format!("{}: the data cannot be true as described: {why}", dataset.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(columns: &str, keys: &str, csv: &str) -> Run {
        let manifest = format!(
            "[dataset]\nname='x'\n[train]\nfile='train.toml'\n[columns]\nspeed={{column='v',unit='km/h'}}\n\
             {columns}\n[[runs]]\nfile='1.csv'\n{keys}\n"
        );
        let train = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n[resistance]\n\
                     a=1\nb=0\nc=0\n";
        let files = [("dataset.toml", &manifest[..]), ("train.toml", train), ("1.csv", csv)];
        Dataset::load(&files[..]).unwrap().runs.remove(0)
    }

    #[test]
    fn a_mass_has_the_decimals_that_its_size_deserves() {
        assert_eq!([tonnes(1443.0), tonnes(407_122.0)], ["1.443", "407.1"]);
    }

    #[test]
    fn a_recorded_mass_is_shown_with_its_range() {
        let seconds = "time={column='t',unit='s'}";
        let with_mass = format!("{seconds}\ntrain_mass={{column='m',unit='t'}}");
        let of = |columns: &str, keys: &str, csv: &str| mass_t(&run(columns, keys, csv));
        assert_eq!(of(&with_mass, "", "t,v,m\n0,1,198\n1,2,222\n2,3,210\n"), "210.0 (198.0–222.0)");
        assert_eq!(of(&with_mass, "", "t,v,m\n0,1,198\n1,2,198\n"), "198.0");
        assert_eq!(of(seconds, "mass_t=120", "t,v\n0,1\n1,2\n"), "120.0");
        assert_eq!(of(seconds, "", "t,v\n0,1\n1,2\n"), "100.0");
    }

    #[test]
    fn a_run_is_of_the_day_that_its_file_or_the_dataset_says() {
        let of = |columns: &str, keys: &str, csv: &str| recorded_in_words(&run(columns, keys, csv));
        let (iso, clock) = ("time={column='t',format='iso'}", "time={column='t',format='clock'}");
        let dated = "t,v\n2026-03-18T23:59:59.5,1\n2026-03-19T00:00:00.5,2\n";
        assert_eq!(of(iso, "", dated), "2026-03-18 23:59:59");
        let timed = "t,v\n23:59:59.5,1\n00:00:00.5,2\n";
        assert_eq!(of(clock, "date=2026-03-18", timed), "2026-03-18 23:59:59");
        assert_eq!(of(clock, "", timed), "–");
        let seconds = "time={column='t',unit='s'}";
        assert_eq!(
            of(seconds, "date=2026-03-18T07:13:20", "t,v\n0,1\n1,2\n"),
            "2026-03-18 07:13:20"
        );
        let samples = run(iso, "", dated).samples;
        assert_eq!(samples[1].time_ns - samples[0].time_ns, 1_000_000_000);
    }
}

#[cfg(test)]
mod clock_tests {
    use super::*;

    #[test]
    fn times_from_1970_are_dates_and_others_are_not() {
        let date = |time_s| moment(time_s).map(|it| it.to_string());
        assert_eq!(date(1_738_479_600.0).as_deref(), Some("2025-02-02T07:00:00Z"));
        assert_eq!(date(1_738_479_600.75).as_deref(), Some("2025-02-02T07:00:00Z"));
        assert_eq!([0.0, 86_400.0 * 31.0, f64::NAN, -1.0].map(date), [const { None }; 4]);
    }
}
