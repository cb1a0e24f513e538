//! Names and units of the recorded quantities.

use dynocar_shared::{SampleField, TrainSample};

use super::random::SimulatorRandom;
use super::run_maker::RunPlan;

/// Contents of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Time.
    Time,
    /// Position of the train's centre, or of its head.
    Position,
    /// Speed.
    Speed,
    /// Traction force.
    TractionForce,
    /// Brake force.
    BrakeForce,
    /// Traction minus brake force.
    ControlForce,
    /// Brake-cylinder pressure.
    Pressure,
    /// Outside temperature.
    Temperature,
    /// 1 while the controller sees the wheels slip.
    WheelSlide,
}

impl ColumnKind {
    /// Returns the canonical name in `dataset.toml`.
    pub const fn canonical(self) -> &'static str {
        match self {
            ColumnKind::Time => "time",
            ColumnKind::Position => "position",
            ColumnKind::Speed => "speed",
            ColumnKind::TractionForce => "traction_force",
            ColumnKind::BrakeForce => "brake_force",
            ColumnKind::ControlForce => "control_force",
            ColumnKind::Pressure => "brake_cylinder_pressure",
            ColumnKind::Temperature => "ambient_temperature",
            ColumnKind::WheelSlide => "wheel_slide",
        }
    }

    /// (unit, file value per SI value, addend after that, decimals) to choose from.
    const fn units(self) -> &'static [(&'static str, f64, f64, usize)] {
        match self {
            ColumnKind::Time => &[("s", 1.0, 0.0, 3), ("ms", 1e3, 0.0, 0)],
            ColumnKind::Position => &[("m", 1.0, 0.0, 1), ("km", 1e-3, 0.0, 4)],
            ColumnKind::Speed => {
                &[("m/s", 1.0, 0.0, 2), ("km/h", 3.6, 0.0, 3), ("mph", 1.0 / 0.44704, 0.0, 3)]
            }
            ColumnKind::TractionForce | ColumnKind::BrakeForce | ColumnKind::ControlForce => {
                &[("N", 1.0, 0.0, 0), ("kN", 1e-3, 0.0, 2)]
            }
            ColumnKind::Pressure => {
                &[("Pa", 1.0, 0.0, 0), ("kPa", 1e-3, 0.0, 1), ("bar", 1e-5, 0.0, 3)]
            }
            ColumnKind::Temperature => {
                &[("degC", 1.0, 0.0, 1), ("K", 1.0, 273.15, 2), ("degF", 1.8, 32.0, 1)]
            }
            ColumnKind::WheelSlide => &[("1", 1.0, 0.0, 0)],
        }
    }

    /// Column names in several houses' styles; `{u}` stands for the unit.
    const fn names(self) -> [&'static str; 5] {
        match self {
            ColumnKind::Time => ["time_{u}", "Time [{u}]", "zeit", "t", "timestamp"],
            ColumnKind::Position => ["position_{u}", "Chainage [{u}]", "weg", "s", "odo"],
            ColumnKind::Speed => ["speed_{u}", "Speed [{u}]", "v_ist", "v", "velocity"],
            ColumnKind::TractionForce => {
                ["traction_{u}", "Tractive effort [{u}]", "f_zug", "te", "tractionForce"]
            }
            ColumnKind::BrakeForce => {
                ["braking_{u}", "Brake effort [{u}]", "f_brems", "be", "brakeForce"]
            }
            ColumnKind::ControlForce => {
                ["control_{u}", "Wheel rim force [{u}]", "f_rad", "f", "controlForce"]
            }
            ColumnKind::Pressure => {
                ["cylinder_{u}", "BC pressure [{u}]", "p_c", "bcp", "brakePressure"]
            }
            ColumnKind::Temperature => {
                ["outside_{u}", "Outside temp [{u}]", "t_aussen", "oat", "ambient"]
            }
            ColumnKind::WheelSlide => ["slide", "Wheel slide", "gleiten", "ws", "wheelSlide"],
        }
    }
}

/// A column of the run files.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Quantity of the column.
    pub quantity: ColumnKind,
    /// Its name in the files.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Canonical value in `unit` = file value * scale.
    pub scale: f64,
    per_si: f64,
    addend: f64,
    decimals: usize,
}

impl Column {
    /// A train without an odometer has no position of its own.
    pub fn is_written(&self, has_odometer: bool) -> bool {
        has_odometer || self.quantity != ColumnKind::Position
    }

    /// Returns the file's text for an SI value.
    pub fn text(&self, si: f64) -> String {
        let value = (si * self.per_si + self.addend) / self.scale;
        format!("{value:.*}", self.decimals)
    }
}

/// How a dataset's run files look.
#[derive(Clone, Debug, PartialEq)]
pub struct FileStyle {
    /// The columns in order.
    pub columns: Vec<Column>,
    /// Between columns.
    pub delimiter: char,
    /// True when the position is that of the train's head.
    pub is_head_position: bool,
    /// True when the files hold a column that is mapped to nothing.
    pub has_row_numbers: bool,
}

/// Draws a style; ideal recordings are written with `extra_decimals` more.
pub fn make_style(extra_decimals: usize, random: &mut SimulatorRandom) -> FileStyle {
    let house = random.integer(0, 4);
    let has_control_force = random.chance(0.2);
    let mut quantities = vec![ColumnKind::Time, ColumnKind::Position, ColumnKind::Speed];
    if has_control_force {
        quantities.push(ColumnKind::ControlForce);
    } else {
        quantities.extend([ColumnKind::TractionForce, ColumnKind::BrakeForce]);
    }
    quantities.extend([ColumnKind::Pressure, ColumnKind::Temperature]);
    if random.chance(0.4) {
        quantities.push(ColumnKind::WheelSlide);
    }
    let columns = quantities
        .into_iter()
        .map(|quantity| {
            let (unit, per_si, addend, decimals) = random.pick(quantity.units());
            // Some loggers write raw counts of a thousandth.
            let is_raw = quantity == ColumnKind::Pressure && random.chance(0.25);
            let (scale, decimals) =
                if is_raw { (1e-3, 0) } else { (1.0, decimals + extra_decimals) };
            let is_whole = matches!(quantity, ColumnKind::Time | ColumnKind::WheelSlide);
            let plain = quantity.units().iter().find(|choice| choice.0 == unit);
            let decimals =
                if is_whole { plain.map_or(decimals, |choice| choice.3) } else { decimals };
            let suffix = unit.replace('/', "p").to_lowercase();
            let unit_text = if house == 0 { suffix.as_str() } else { unit };
            let name = quantity.names()[house].replace("{u}", unit_text);
            Column { quantity, name, unit, scale, per_si, addend, decimals }
        })
        .collect();
    FileStyle {
        columns,
        delimiter: if random.chance(0.3) { ';' } else { ',' },
        is_head_position: random.chance(0.2),
        has_row_numbers: random.chance(0.3),
    }
}

/// Returns a row of a run file; a missing value is an empty cell.
pub fn row_text(
    sample: &TrainSample,
    style: &FileStyle,
    plan: &RunPlan,
    train_length_m: f64,
    number: usize,
    has_odometer: bool,
) -> String {
    let head_m = if style.is_head_position { 0.5 * train_length_m * plan.direction } else { 0.0 };
    let written = style.columns.iter().filter(|it| it.is_written(has_odometer));
    let cells = written.map(|column| {
        let value = match column.quantity {
            ColumnKind::Time => Some(sample.time_ns as f64 * 1e-9),
            ColumnKind::Position => sample.get(SampleField::Position).map(|centre| centre + head_m),
            ColumnKind::Speed => sample.get(SampleField::Speed),
            ColumnKind::TractionForce => sample.get(SampleField::TractionForce),
            ColumnKind::BrakeForce => sample.get(SampleField::BrakeForce),
            ColumnKind::ControlForce => control_force_n(sample),
            ColumnKind::Pressure => sample.get(SampleField::BrakeCylinderPressure),
            ColumnKind::Temperature => sample.get(SampleField::AmbientTemperature),
            ColumnKind::WheelSlide => Some(f64::from(sample.flags & 1)),
        };
        value.map_or_else(String::new, |si| column.text(si))
    });
    let number = style.has_row_numbers.then(|| number.to_string());
    let delimiter = style.delimiter.to_string();
    number.into_iter().chain(cells).collect::<Vec<_>>().join(&delimiter)
}

fn control_force_n(sample: &TrainSample) -> Option<f64> {
    let traction_n = sample.get(SampleField::TractionForce)?;
    Some(traction_n - sample.get(SampleField::BrakeForce)?)
}
