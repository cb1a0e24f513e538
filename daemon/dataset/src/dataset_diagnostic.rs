//! Diagnostics to know before results from a dataset are believed, each once: those of its runs, and declarations of
//! the train and the line that cannot be true.

use std::collections::BTreeMap;

use dynocar_core::plausibility::window_balance::WindowBalance;
use dynocar_core::plausibility::{
    DetectedFault, Severity, gradient_fault, mirrored_line, other_line,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_model::train::numbers::LENGTH;
use dynocar_model::units::Unit;
use serde::Serialize;

use super::Dataset;
use super::diagnostic::{Diagnostic, unusual_resistance};
use super::keys::assign;
use super::manifest::Role;
use super::resolved::GradientSource;
use super::run::Run;
use super::speed_and_position::PositionSource;

/// A diagnostic on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DatasetDiagnostic {
    /// Its name for machines.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// The files of the runs it is about; empty when it is about the train or the line.
    pub runs: Vec<String>,
    /// Text with figures and the likely input fault.
    pub text: String,
}

impl std::fmt::Display for DatasetDiagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.runs[..] {
            [] => f.write_str(&self.text),
            [run] => write!(f, "{run}: {}", self.text),
            [first, .., last] => {
                write!(f, "{first} … {last} ({} runs): {}", self.runs.len(), self.text)
            }
        }
    }
}

impl DatasetDiagnostic {
    /// Returns the diagnostic with a word for how much it matters.
    pub fn labelled(&self) -> String {
        format!("{}: {self}", self.severity.label())
    }
}

impl Dataset {
    /// Returns the diagnostics that may spoil results from these runs, the worst first.
    pub fn diagnostics(&self) -> Vec<DatasetDiagnostic> {
        diagnostics(&self.train, self.track.as_deref(), &self.runs)
    }
}

/// Returns the diagnostics that may spoil results from runs of a train on a line, the worst first.
pub fn diagnostics<'r>(
    train: &TrainModel,
    track: Option<&Track>,
    runs: impl IntoIterator<Item = &'r Run>,
) -> Vec<DatasetDiagnostic> {
    let of = |runs, it: &Diagnostic| DatasetDiagnostic {
        code: it.code,
        severity: it.severity,
        runs,
        text: it.text.clone(),
    };
    let of_declared = misdeclared(train, track);
    let mut diagnostics: Vec<_> = of_declared.iter().map(|it| of(Vec::new(), it)).collect();
    // The factors of an input fault that several runs share, from the lowest to the highest.
    let mut faults: Vec<(usize, DetectedFault, Unit, (f64, f64))> = Vec::new();
    let mut all = AllRuns::default();
    for run in runs {
        all.push(run);
        for diagnostic in run.diagnostics.iter().filter(|it| it.severity > Severity::Info) {
            let known = match diagnostic.fault {
                Some((detected, read_as)) => {
                    let known = faults.iter_mut().find(|(_, other, unit, (low, _))| {
                        other.fault == detected.fault
                            && *unit == read_as
                            && (*low < 1.0) == (detected.factor < 1.0)
                    });
                    known.map(|(index, .., range)| {
                        *range = (range.0.min(detected.factor), range.1.max(detected.factor));
                        *index
                    })
                }
                None => diagnostics.iter().position(|other: &DatasetDiagnostic| {
                    let is_of_runs = other.code == diagnostic.code && !other.runs.is_empty();
                    is_of_runs && other.text == diagnostic.text
                }),
            };
            match known {
                Some(index) => diagnostics[index].runs.push(run.file.clone()),
                None => {
                    if let Some((detected, read_as)) = diagnostic.fault {
                        let range = (detected.factor, detected.factor);
                        faults.push((diagnostics.len(), detected, read_as, range));
                    }
                    diagnostics.push(of(vec![run.file.clone()], diagnostic));
                }
            }
        }
    }
    for (index, detected, read_as, range) in faults {
        diagnostics[index].text = detected.words_for(range, &read_as);
    }
    let of_line = all.mirrored_line().or_else(|| all.gradient_scale());
    diagnostics.extend(of_line.or_else(|| all.other_line()));
    diagnostics.extend(all.copies());
    diagnostics.sort_by_key(|diagnostic| std::cmp::Reverse(diagnostic.severity));
    diagnostics
}

/// Code of the diagnostic that the line may be another one than that of the runs.
pub const OTHER_LINE: &str = "other_line";

/// Sums over all runs: together they show faults that each is too short to show, as one from stop to stop.
#[derive(Default)]
struct AllRuns {
    balance: Option<(WindowBalance, Unit)>,
    /// Of the runs whose gradients are the line's at recorded positions: as it is, and read from its other end.
    on_line: Option<[WindowBalance; 2]>,
    files: Vec<String>,
    /// Runs by the hash of their motion: files, and whether one is to fit and one held out.
    motions: BTreeMap<u64, (Vec<String>, [bool; 2])>,
    has_fault: bool,
}

impl AllRuns {
    fn push(&mut self, run: &Run) {
        let of_all = || (WindowBalance::of_all(), run.gradient_unit);
        self.balance.get_or_insert_with(of_all).0.add(&run.balance);
        if run.gradient_source == GradientSource::Track
            && run.position_source == PositionSource::Column
        {
            let [own, mirrored] = self.on_line.get_or_insert_with(|| [WindowBalance::of_all(); 2]);
            own.add(&run.balance);
            mirrored.add(&run.mirrored);
        }
        self.files.push(run.file.clone());
        if let Some(hash) = run.motion_hash {
            let (files, has_role) = self.motions.entry(hash).or_default();
            files.push(run.file.clone());
            has_role[usize::from(run.role == Role::Holdout)] = true;
        }
        self.has_fault |= run.diagnostics.iter().any(|it| it.fault.is_some());
    }

    /// Returns the runs that hold the motion of others, where one is held out and where none is.
    fn copies(&self) -> impl Iterator<Item = DatasetDiagnostic> {
        let text = |is_held_out| match is_held_out {
            true => {
                "of these runs, one that is held out has the times and speeds of one to fit: it tests nothing; hold another \
                 run out"
            }
            false => {
                "each of these runs has the times and speeds of another of them, and counts more than once: leave the \
                 copies out"
            }
        };
        let diagnostic = move |is_held_out| {
            let copies = self.motions.values().filter(move |(files, has_role)| {
                files.len() > 1 && (*has_role == [true, true]) == is_held_out
            });
            let runs: Vec<String> = copies.flat_map(|it| it.0.iter().cloned()).collect();
            let (code, severity, text) =
                ("copied_run", Severity::Warning, text(is_held_out).into());
            (!runs.is_empty()).then_some(DatasetDiagnostic { code, severity, runs, text })
        };
        [true, false].into_iter().filter_map(diagnostic)
    }

    /// Returns that the gradients are in another unit, where no run shows a fault by itself.
    fn gradient_scale(&self) -> Option<DatasetDiagnostic> {
        let (balance, read_as) = self.balance.filter(|_| !self.has_fault)?;
        Some(self.of_all(Diagnostic::of_fault(gradient_fault(&balance)?, read_as)))
    }

    /// Returns that the line is described from its other end.
    fn mirrored_line(&self) -> Option<DatasetDiagnostic> {
        let [own, mirrored] = &self.on_line?;
        let factor = mirrored_line(own, mirrored)?;
        let text = match factor {
            ..0.0 => {
                "the train moves as on the line's gradients read from its other end with the other sign: do the \
                 chainages of the track and the positions of the runs begin at the same end, and does climbing \
                 count as positive?"
            }
            _ => {
                "the train moves as on the line's gradients read from its other end: do the chainages of the track \
                 and the positions of the runs begin at the same end?"
            }
        };
        let figures = [("factor", factor.into())];
        Some(self.of_all(Diagnostic::new("mirrored_line", Severity::Fundamental, text, figures)))
    }

    /// Returns that the line is another one, where no run shows a fault that would hide it.
    fn other_line(&self) -> Option<DatasetDiagnostic> {
        let [balance, _] = self.on_line.filter(|_| !self.has_fault)?;
        let share = other_line(&balance)?;
        let text = format!(
            "of the track's gradients, {:.1} ‰ on average, hardly any shows in the motion of the train: is it the line \
             of these runs, and do its chainages and the positions count from the same place?",
            balance.gradient_rms_permille()
        );
        let figures = [("share", share.into())];
        Some(self.of_all(Diagnostic::new(OTHER_LINE, Severity::Warning, text, figures)))
    }

    fn of_all(&self, found: Diagnostic) -> DatasetDiagnostic {
        let Diagnostic { code, severity, text, .. } = found;
        DatasetDiagnostic { code, severity, runs: self.files.clone(), text }
    }
}

/// Masses per metre of train in t/m: from a light rail car to a loaded ore train, with a margin.
const MASS_PER_LENGTH_T_PER_M: (f64, f64) = (0.1, 20.0);
/// Lengths in m of a vehicle or a train; 1 m stands for a train taken as a point.
const LENGTH_M: (f64, f64) = (1.0, 8000.0);
const POINT_LENGTH_M: f64 = 1.0;
/// Greatest extent of a line's places, in lengths of it: a survey may reach beyond its ends.
const LINE_LENGTHS_MAX: f64 = 2.0;
/// Greatest accelerations in m/s² by the effort curves.
const EFFORT_MPS2: (f64, f64) = (0.01, 10.0);
/// Basic resistances in N/kN at any speed.
const RESISTANCE_N_PER_KN: (f64, f64) = (0.05, 200.0);

/// Returns the impossible declarations of a train and its line.
pub fn misdeclared(train: &TrainModel, track: Option<&Track>) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let say = |found: &mut Vec<Diagnostic>, is_wrong: bool, code: &'static str, text: String| {
        if is_wrong {
            found.push(Diagnostic::new(code, Severity::Fundamental, text, []));
        }
    };
    let is_outside = |value: f64, (low, high): (f64, f64)| !(low..=high).contains(&value);
    let (mass_t, length_m) = (train.mass_kg / 1000.0, train.length_m);
    let is_length = is_outside(length_m, LENGTH_M);
    say(
        &mut found,
        is_length,
        "length_scale",
        format!("a train of {}: is the length in m?", assign(LENGTH.name, length_m)),
    );
    let per_m = mass_t / length_m;
    say(
        &mut found,
        !is_length && length_m > POINT_LENGTH_M && is_outside(per_m, MASS_PER_LENGTH_T_PER_M),
        "mass_per_length",
        format!(
            "{mass_t} t on {length_m} m are {per_m:.2e} t/m: is mass_t in t (not kg), length_m in m?"
        ),
    );
    for (name, curve) in [("traction", &train.traction), ("brake", &train.brake)] {
        let Some(greatest_n) = curve.as_ref().map(|curve| curve.force_max_n()) else { continue };
        let greatest_mps2 = greatest_n / train.mass_kg;
        say(
            &mut found,
            greatest_n > 0.0 && is_outside(greatest_mps2, EFFORT_MPS2),
            "effort_scale",
            format!(
                "the [{name}] effort of {:.4} kN would move {mass_t} t at {greatest_mps2:.1e} \
                 m/s²: is it in kN, and mass_t in t?",
                greatest_n / 1000.0
            ),
        );
    }
    let top_mps = train.speed_max_mps().unwrap_or(20.0);
    let w0 = train.resistance.w0_n_per_kn(top_mps);
    say(
        &mut found,
        w0 != 0.0 && is_outside(w0, RESISTANCE_N_PER_KN),
        "resistance_scale",
        format!(
            "a, b and c give {w0:.2e} N/kN at {top_mps:.0} m/s: are they per kN of weight, with v \
             in m/s?"
        ),
    );
    if let (false, Some(text)) = (
        found.iter().any(|it| it.code == "resistance_scale"),
        unusual_resistance(&train.resistance, top_mps),
    ) {
        let text = format!("the resistance is {text}");
        found.push(Diagnostic::new("unusual_resistance", Severity::Warning, text, []));
    }
    found.extend(track.and_then(|track| of_line(train, track)));
    found
}

/// Returns the diagnostic of a line that cannot be as long as declared.
fn of_line(train: &TrainModel, track: &Track) -> Option<Diagnostic> {
    let line_m = track.length_m?;
    let text = match chainages_m(track) {
        _ if line_m < train.length_m => {
            format!("a line of {line_m} m is shorter than the train: is length_m in m?")
        }
        Some((from_m, to_m)) if to_m - from_m > LINE_LENGTHS_MAX * line_m => format!(
            "a line of {line_m} m has gradients, curves or tunnels from {from_m} m to {to_m} m: are all in m?"
        ),
        _ => return None,
    };
    Some(Diagnostic::new("line_length", Severity::Fundamental, text, []))
}

/// Returns the least and the greatest chainage in m of a line's gradients, curves and tunnels; `None` without any.
fn chainages_m(track: &Track) -> Option<(f64, f64)> {
    let gradients = track.gradient().into_iter().flat_map(|it| it.entries().map(|entry| entry.0));
    let curves = track.curves().iter().flat_map(|it| [it.start_m, it.end_m]);
    let tunnels = track.tunnels().iter().flat_map(|it| [it.start_m, it.end_m]);
    let all: Vec<f64> = gradients.chain(curves).chain(tunnels).collect();
    all.iter().copied().reduce(f64::min).zip(all.iter().copied().reduce(f64::max))
}

#[cfg(test)]
mod tests {
    use dynocar_model::train::{BrakeGear, Davis, EffortCurve};

    use crate::parse_track;

    use super::*;

    fn codes(change: impl Fn(&mut TrainModel)) -> Vec<&'static str> {
        codes_on(None, change)
    }

    fn codes_on(line: Option<Track>, change: impl Fn(&mut TrainModel)) -> Vec<&'static str> {
        let mut train = TrainModel {
            name: String::new(),
            mass_kg: 200e3,
            length_m: 100.0,
            cars: 4,
            full_mass_kg: None,
            passenger_mass_kg: 70.0,
            rotating_mass_factor: 0.06,
            resistance: Davis { a: 1.8, b: 0.03, c: 0.0035 },
            curve_constant_n_per_kn_m: 600.0,
            tunnel_constant_n_per_kn_m: 0.0,
            traction: EffortCurve::new(vec![(0.0, 200e3), (40.0, 60e3)]),
            brake: EffortCurve::new(vec![(0.0, 220e3)]),
            drive: None,
            brake_gear: BrakeGear::default(),
            corrections: Default::default(),
            extra: Vec::new(),
        };
        change(&mut train);
        misdeclared(&train, line.as_ref()).into_iter().map(|it| it.code).collect()
    }

    #[test]
    fn a_line_much_shorter_than_its_gradients_or_tunnels_is_reported() {
        let line = |text: &str| Some(parse_track("track.toml", text).unwrap());
        let none: [&str; 0] = [];
        let usual = "[track]\nname='l'\nlength_m=12000\ngradient=[[500000,1.0],[513000,0.0]]";
        assert_eq!(codes_on(line(usual), |_| {}), none, "chainages need not begin at 0");
        for places in
            ["gradient=[[0,1.0],[999750,0.0]]", "tunnels=[[99000,99500]]\ngradient=[[0,0.0]]"]
        {
            let text = format!("[track]\nname='l'\nlength_m=1000\n{places}");
            assert_eq!(codes_on(line(&text), |_| {}), ["line_length"], "{places}");
        }
    }

    #[test]
    fn a_declared_train_in_wrong_units_is_reported_and_another_is_not() {
        let none: [&str; 0] = [];
        assert_eq!(codes(|_| {}), none);
        assert_eq!(codes(|train| train.length_m = 1.0), none, "a point");
        assert_eq!(codes(|train| train.length_m = 0.1), ["length_scale"]);
        let heavy = ["mass_per_length", "effort_scale", "effort_scale"];
        assert_eq!(codes(|train| train.mass_kg *= 1e3), heavy);
        let curve = EffortCurve::new(vec![(0.0, 200e6)]);
        assert_eq!(codes(|train| train.traction.clone_from(&curve)), ["effort_scale"]);
        assert_eq!(codes(|train| train.resistance.a = 2400.0), ["resistance_scale"]);
        assert_eq!(codes(|train| train.resistance.a = 0.0018), ["unusual_resistance"]);
        assert_eq!(codes(|train| train.resistance.c *= 12.96), ["unusual_resistance"]);
    }
}
