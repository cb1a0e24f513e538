//! Traction and brake force of a run's rows, the electric power that the traction force may come from, and forces that
//! act before their time stamps, since some recorders average over the time before the stamp.

use std::borrow::Cow;

use dynocar_model::train::{EffortCurve, PowerTrain, TrainModel};
use serde::Serialize;

use super::order::{TimeOrder, quantile};
use super::quantity::Quantity;
use super::speed_and_position::spikes;
use super::table::Table;

/// Share of the greatest force by which a force may lie below zero as noise.
const NOISE_SHARE: f64 = 0.02;
/// Share of the greatest force below which a difference from the neighbours is no spike.
const SPIKE_SHARE: f64 = 0.3;
/// Step in s between rows above which they cannot distinguish a spike from a short application.
const SPIKE_STEP_MAX_S: f64 = 0.5;
/// Greatest distance of a handle beyond 0 or 1 that is noise around the stop.
const HANDLE_NOISE: f64 = 0.02;
/// Quantile that counts as the greatest force of a run, so that spikes do not set it.
const GREATEST_QUANTILE: f64 = 0.99;

/// Where a run's force comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceSource {
    /// Its own column.
    Column,
    /// The signed `control_force`.
    ControlForce,
    /// The share of the effort curve in the handle's column.
    Handle,
    /// The declared friction brake at the recorded pressure.
    Pressure,
    /// The electric power of the drive over the speed.
    Power,
    /// It is not recorded.
    None,
}

/// One of the two forces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Force {
    /// Force in N, `NaN` where missing.
    pub force_n: Vec<f64>,
    /// Where it comes from.
    pub source: ForceSource,
    /// Marks outliers.
    pub is_spike: Vec<bool>,
    /// Forces below zero by noise, counted as the other force.
    pub zeroed: usize,
    /// Forces that stay negative.
    pub negative: usize,
    /// Handles outside 0 to 1, whose force counts as missing.
    pub handle_out_of_range: usize,
}

/// Both forces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Forces {
    /// Traction.
    pub traction: Force,
    /// Brake.
    pub brake: Force,
    /// The greatest of either force in N; 0 when none is recorded.
    pub greatest_n: f64,
}

impl Forces {
    /// From the columns; handles need the speeds.
    ///
    /// A force slightly below zero is noise around zero. It is counted as the other force, so that traction minus brake
    /// stays as measured: setting it to zero would let half of the noise pass and bias every coasting. Where the other
    /// force is missing, it is set to zero.
    pub fn new(table: &Table, speed_mps: &[f64], train: &TrainModel, order: &TimeOrder) -> Self {
        let (mut traction, mut brake) = match table.column(Quantity::ControlForce) {
            Some(control) => split(control, ForceSource::ControlForce),
            None => recorded(table, speed_mps, train),
        };
        if traction.source == ForceSource::None {
            by_power(table, speed_mps, train, (&mut traction, &mut brake));
        }
        add_friction(&mut brake, table.column(Quantity::BrakeCylinderPressure), train);
        let greatest_n = [(&traction, &train.traction), (&brake, &train.brake)]
            .map(|(force, curve)| force.greatest_n(curve.as_ref()))
            .into_iter()
            .fold(0.0, f64::max);
        exchange_noise(&mut traction, &mut brake, NOISE_SHARE * greatest_n);
        for force in [&mut traction, &mut brake] {
            force.is_spike = match order.counts.step_s <= SPIKE_STEP_MAX_S {
                true => spikes::<3>(&force.force_n, &order.in_order, SPIKE_SHARE * greatest_n),
                false => vec![false; force.force_n.len()],
            };
        }
        Forces { traction, brake, greatest_n }
    }
}

impl Force {
    fn read(
        force: Option<&[f64]>,
        handle: Option<&[f64]>,
        curve: Option<&EffortCurve>,
        speed_mps: &[f64],
    ) -> Self {
        match (force, handle, curve) {
            (Some(column), _, _) => Force::new(column.to_vec(), ForceSource::Column),
            (None, Some(handle), Some(curve)) => Force::by_handle(handle, curve, speed_mps),
            _ => Force::new(vec![f64::NAN; speed_mps.len()], ForceSource::None),
        }
    }

    fn by_handle(handle: &[f64], curve: &EffortCurve, speed_mps: &[f64]) -> Self {
        let mut out_of_range = 0;
        let force = handle.iter().zip(speed_mps).map(|(&handle, &speed)| {
            if handle.is_nan() || speed.is_nan() {
                return f64::NAN;
            }
            if !(-HANDLE_NOISE..=1.0 + HANDLE_NOISE).contains(&handle) {
                out_of_range += 1;
                return f64::NAN;
            }
            handle.clamp(0.0, 1.0) * curve.force_n(speed)
        });
        let mut force = Force::new(force.collect(), ForceSource::Handle);
        force.handle_out_of_range = out_of_range;
        force
    }

    fn new(force_n: Vec<f64>, source: ForceSource) -> Self {
        let is_spike = Vec::new();
        Force { force_n, source, is_spike, zeroed: 0, negative: 0, handle_out_of_range: 0 }
    }

    /// Returns the declared greatest force in N, else the recorded one.
    fn greatest_n(&self, curve: Option<&EffortCurve>) -> f64 {
        if let (Some(curve), true) = (curve, self.source != ForceSource::None) {
            return curve.force_max_n();
        }
        let sizes = self.force_n.iter().map(|force| force.abs()).filter(|size| *size > 0.0);
        quantile(&mut sizes.collect::<Vec<_>>(), GREATEST_QUANTILE).unwrap_or(0.0)
    }
}

/// Returns both forces by their own columns or handles.
fn recorded(table: &Table, speed_mps: &[f64], train: &TrainModel) -> (Force, Force) {
    let traction = Force::read(
        table.column(Quantity::TractionForce),
        table.column(Quantity::TractionHandle),
        train.traction.as_ref(),
        speed_mps,
    );
    let brake = Force::read(
        table.column(Quantity::BrakeForce),
        table.column(Quantity::BrakeHandle),
        train.brake.as_ref(),
        speed_mps,
    );
    (traction, brake)
}

/// Where power is recorded: traction by the power that the drive takes, and the brake force, unless
/// it is recorded itself, by the power that the drive feeds back.
fn by_power(
    table: &Table,
    speed_mps: &[f64],
    train: &TrainModel,
    (traction, brake): (&mut Force, &mut Force),
) {
    let Some(power_w) = recorded_w(table) else { return };
    let drive = train.drive.unwrap_or(PowerTrain::USUAL);
    let control = power_w.iter().zip(speed_mps);
    let control: Vec<f64> =
        control.map(|(&w, &mps)| drive.force_n(w, mps).unwrap_or(f64::NAN)).collect();
    let (pulls, feeds_back) = split(&control, ForceSource::Power);
    *traction = pulls;
    if brake.source == ForceSource::None {
        *brake = feeds_back;
    }
}

/// Returns the traction and brake from their difference.
fn split(control: &[f64], source: ForceSource) -> (Force, Force) {
    let part = |sign: f64| {
        let part = |&force: &f64| if force.is_nan() { f64::NAN } else { (sign * force).max(0.0) };
        Force::new(control.iter().map(part).collect(), source)
    };
    (part(1.0), part(-1.0))
}

/// Adds the force that the friction brake makes of its pressure to the recorded brake force, or to zero where no brake
/// force is recorded. A missing pressure leaves the brake force unknown.
fn add_friction(brake: &mut Force, pressure_pa: Option<&[f64]>, train: &TrainModel) {
    let (Some(pressure_pa), Some(friction)) = (pressure_pa, train.brake_gear.friction_brake) else {
        return;
    };
    for (force_n, &pressure_pa) in brake.force_n.iter_mut().zip(pressure_pa) {
        let friction_n =
            if pressure_pa.is_nan() { f64::NAN } else { friction.force_n(pressure_pa) };
        *force_n = if brake.source == ForceSource::None { 0.0 } else { *force_n } + friction_n;
    }
    if brake.source == ForceSource::None {
        brake.source = ForceSource::Pressure;
    }
}

/// Counts the noise below zero of either force as the other.
fn exchange_noise(traction: &mut Force, brake: &mut Force, noise_n: f64) {
    for row in 0..traction.force_n.len() {
        let (traction_n, brake_n) = (traction.force_n[row], brake.force_n[row]);
        hand_over(traction_n, noise_n, row, traction, brake);
        hand_over(brake_n, noise_n, row, brake, traction);
    }
}

fn hand_over(force_n: f64, noise_n: f64, row: usize, from: &mut Force, to: &mut Force) {
    if force_n < -noise_n {
        from.negative += 1;
    } else if force_n < 0.0 {
        from.zeroed += 1;
        from.force_n[row] -= force_n;
        to.force_n[row] -= force_n;
    }
}

/// Returns a run's power in W, row by row, `NaN` where missing and negative where regenerated: the drive's own power,
/// else the line's.
pub(super) fn recorded_w(table: &Table) -> Option<Cow<'_, [f64]>> {
    table.filled(Quantity::TractionPower).map(Cow::from).or_else(|| line_power_w(table))
}

/// Power from the line in W, by its own column, else by voltage and current.
pub(super) fn line_power_w(table: &Table) -> Option<Cow<'_, [f64]>> {
    if let Some(power_w) = table.filled(Quantity::LinePower) {
        return Some(power_w.into());
    }
    let (volts, amperes) =
        table.filled(Quantity::LineVoltage).zip(table.filled(Quantity::LineCurrent))?;
    Some(volts.iter().zip(amperes).map(|(volts, amperes)| volts * amperes).collect())
}

/// Forces stamped late by less than this many s, or standard deviations, do not count as late.
const LATE_MIN: (f64, f64) = (0.01, 3.0);
/// A force is not taken across a longer step in s.
const STEP_MAX_S: f64 = 2.5;

/// Returns whether forces act long enough before their stamps that it counts.
pub fn is_stamped_late(late_s: f64, std_s: f64) -> bool {
    late_s > LATE_MIN.0 && late_s > LATE_MIN.1 * std_s
}

/// Returns the force that acts at a stamp, where forces are stamped `late_s` late: the value `late_s` later on a
/// straight line to the next sample, `step_s` ahead.
#[inline]
pub fn stamped_late(here: f64, ahead: f64, step_s: f64, late_s: f64) -> f64 {
    let is_near = step_s > 0.0 && step_s <= STEP_MAX_S;
    if is_near { here + (late_s / step_s).min(1.0) * (ahead - here) } else { here }
}

#[cfg(test)]
mod tests {
    use super::super::manifest::Manifest;
    use super::super::train_file::parse_train;
    use super::*;

    const TRAIN: &str = "[train]\nmass_t=100\nlength_m=50\nrotating_mass_factor=0\n\
        [resistance]\na=1\nb=0\nc=0\n[traction]\neffort=[[0,100],[10,100],[20,50]]\n\
        [brake]\nmax_force_kn=200\n";

    fn forces(columns: &str, csv: &str) -> Forces {
        forces_of(TRAIN, columns, csv)
    }

    fn forces_of(train: &str, columns: &str, csv: &str) -> Forces {
        let text = format!(
            "[dataset]\nname='x'\n[train]\nfile='t'\n[columns]\ntime={{column='t',unit='s'}}\n\
             speed={{column='v',unit='m/s'}}\n{columns}\n[[runs]]\nfile='a.csv'\n"
        );
        let manifest = Manifest::parse("dataset.toml", &text).unwrap();
        let table = Table::parse("a.csv", csv, (&manifest.layout, &manifest.columns)).unwrap();
        let times = table.column(Quantity::Time).unwrap();
        let order = TimeOrder::new(times, vec![0; times.len()]);
        let train = parse_train("train.toml", train).unwrap();
        Forces::new(&table, table.column(Quantity::Speed).unwrap(), &train, &order)
    }

    const BOTH: &str = "traction_force={column='F',unit='kN'}\nbrake_force={column='B',unit='kN'}";

    #[test]
    fn recorded_forces_are_taken_as_they_are() {
        let forces = forces(BOTH, "t,v,F,B\n0,1,80,0\n1,1,0,150\n2,1,,\n");
        assert_eq!(forces.traction.force_n[..2], [80e3, 0.0]);
        assert_eq!(forces.brake.force_n[..2], [0.0, 150e3]);
        assert!(forces.traction.force_n[2].is_nan() && forces.brake.force_n[2].is_nan());
        assert_eq!((forces.traction.source, forces.greatest_n), (ForceSource::Column, 200e3));
    }

    #[test]
    fn noise_below_zero_is_counted_as_the_other_force() {
        let forces = forces(BOTH, "t,v,F,B\n0,1,-3,1\n1,1,5,-2\n2,1,-1,\n3,1,-50,0\n4,1,-1,-2\n");
        assert_eq!(forces.traction.force_n, [0.0, 7e3, 0.0, -50e3, 2e3]);
        assert_eq!(forces.brake.force_n[..2], [4e3, 0.0]);
        assert!(forces.brake.force_n[2].is_nan());
        assert_eq!(forces.brake.force_n[3..], [0.0, 1e3]);
        assert_eq!((forces.traction.zeroed, forces.traction.negative), (3, 1));
        assert_eq!((forces.brake.zeroed, forces.brake.negative), (2, 0));
    }

    #[test]
    fn a_control_force_is_split_by_sign() {
        let forces =
            forces("control_force={column='C',unit='N'}", "t,v,C\n0,1,5\n1,1,-7\n2,1,0\n3,1,\n");
        assert_eq!(forces.traction.force_n[..3], [5.0, 0.0, 0.0]);
        assert_eq!(forces.brake.force_n[..3], [0.0, 7.0, 0.0]);
        assert!(forces.traction.force_n[3].is_nan() && forces.brake.force_n[3].is_nan());
        assert_eq!(forces.brake.source, ForceSource::ControlForce);
    }

    #[test]
    fn the_friction_brake_acts_by_its_pressure_next_to_the_signed_force() {
        let columns = "control_force={column='C',unit='N'}\n\
                       brake_cylinder_pressure={column='p',unit='kPa'}";
        let brake = "force_per_pressure_n_per_pa=0.5\nrelease_pressure_pa=20000\n";
        let train = format!("{TRAIN}{brake}");
        let forces = forces_of(&train, columns, "t,v,C,p\n0,1,500,10\n1,1,-700,40\n2,1,0,\n");
        assert_eq!(forces.traction.force_n[..2], [500.0, 0.0]);
        assert_eq!(forces.brake.force_n[..2], [0.0, 700.0 + 0.5 * 20e3]);
        assert!(forces.brake.force_n[2].is_nan(), "no pressure, no brake force");
        let alone = "traction_force={column='C',unit='N'}\n\
                     brake_cylinder_pressure={column='p',unit='kPa'}";
        let forces = forces_of(&train, alone, "t,v,C,p\n0,1,500,10\n1,1,0,40\n");
        assert_eq!(forces.brake.force_n, [0.0, 10e3]);
        assert_eq!(forces.brake.source, ForceSource::Pressure);
    }

    #[test]
    fn a_handle_is_a_share_of_the_curve_at_the_speed() {
        let columns = "traction_handle={column='h',unit='%'}\nbrake_handle={column='b',unit='1'}";
        let forces = forces(
            columns,
            "t,v,h,b\n0,5,50,0\n1,15,100,0.25\n2,,100,1\n3,5,101,-0.01\n4,5,150,2\n",
        );
        assert_eq!(forces.traction.force_n[..2], [50e3, 75e3]);
        assert!(forces.traction.force_n[2].is_nan(), "no speed, no force");
        assert_eq!(forces.traction.force_n[3], 100e3);
        assert!(forces.traction.force_n[4].is_nan());
        assert_eq!(forces.brake.force_n[..2], [0.0, 50e3]);
        let out_of_range = (forces.traction.handle_out_of_range, forces.brake.handle_out_of_range);
        assert_eq!((out_of_range, forces.brake.source), ((1, 1), ForceSource::Handle));
    }

    #[test]
    fn power_over_speed_is_the_force_where_none_is_recorded() {
        let train = format!("{TRAIN}force_per_pressure_n_per_pa=0.5\nrelease_pressure_pa=20000\n")
            .replace("[brake]", "efficiency=0.8\nauxiliary_power_kw=10\n[brake]");
        let power = "line_power={column='P',unit='kW'}";
        let rows = "t,v,P,p\n0,10,110,10\n1,10,-70,10\n2,1,110,10\n3,0,10,400\n4,10,10,40\n";
        let pressure = "\nbrake_cylinder_pressure={column='p',unit='kPa'}";
        let found = forces_of(&train, &format!("{power}{pressure}"), rows);
        assert_eq!(
            (found.traction.source, found.brake.source),
            (ForceSource::Power, ForceSource::Power)
        );
        assert_eq!(found.traction.force_n[..2], [8000.0, 0.0]);
        assert!(
            (found.brake.force_n[1] - 10e3).abs() < 1e-9,
            "what comes back was lost on the way"
        );
        assert!(found.traction.force_n[2].is_nan() && found.brake.force_n[2].is_nan());
        assert_eq!(found.brake.force_n[4], 10e3, "the friction brake in addition to it");
        let by_voltage = "line_voltage={column='U',unit='V'}\nline_current={column='I',unit='A'}";
        let found = forces_of(&train, by_voltage, "t,v,U,I\n0,10,500,220\n1,10,500,-140\n");
        assert_eq!(found.traction.force_n, [8000.0, 0.0]);
        let brake = "\nbrake_force={column='B',unit='kN'}";
        let found =
            forces_of(&train, &format!("{power}{brake}"), "t,v,P,B\n0,10,110,0\n1,10,-70,30\n");
        assert_eq!(found.brake.source, ForceSource::Column);
        assert_eq!((found.traction.force_n[1], found.brake.force_n[1]), (0.0, 30e3));
        let beside = "\ntraction_force={column='F',unit='kN'}";
        let found = forces_of(&train, &format!("{power}{beside}"), "t,v,P,F\n0,10,110,7\n");
        assert_eq!(found.traction.force_n, [7e3], "a force that is recorded is the force");
    }

    #[test]
    fn a_force_that_is_not_mapped_is_missing() {
        let forces = forces("traction_force={column='F',unit='N'}", "t,v,F\n0,1,9\n");
        assert_eq!(forces.brake.source, ForceSource::None);
        assert!(forces.brake.force_n[0].is_nan());
    }
}
