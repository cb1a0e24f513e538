//! How the recorded quantities are named and in which units they are written.

use dynocar_shared::{SampleField, TrainSample};

use super::random::Random;
use super::run_maker::RunPlan;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
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

impl Quantity {
    /// The canonical name in `dataset.toml`.
    pub const fn canonical(self) -> &'static str {
        match self {
            Quantity::Time => "time",
            Quantity::Position => "position",
            Quantity::Speed => "speed",
            Quantity::TractionForce => "traction_force",
            Quantity::BrakeForce => "brake_force",
            Quantity::ControlForce => "control_force",
            Quantity::Pressure => "brake_cylinder_pressure",
            Quantity::Temperature => "ambient_temperature",
            Quantity::WheelSlide => "wheel_slide",
        }
    }

    /// (unit, file value per SI value, addend after that, decimals) to choose from.
    const fn units(self) -> &'static [(&'static str, f64, f64, usize)] {
        match self {
            Quantity::Time => &[("s", 1.0, 0.0, 3), ("ms", 1e3, 0.0, 0)],
            Quantity::Position => &[("m", 1.0, 0.0, 1), ("km", 1e-3, 0.0, 4)],
            Quantity::Speed => {
                &[("m/s", 1.0, 0.0, 2), ("km/h", 3.6, 0.0, 3), ("mph", 1.0 / 0.44704, 0.0, 3)]
            }
            Quantity::TractionForce | Quantity::BrakeForce | Quantity::ControlForce => {
                &[("N", 1.0, 0.0, 0), ("kN", 1e-3, 0.0, 2)]
            }
            Quantity::Pressure => {
                &[("Pa", 1.0, 0.0, 0), ("kPa", 1e-3, 0.0, 1), ("bar", 1e-5, 0.0, 3)]
            }
            Quantity::Temperature => {
                &[("degC", 1.0, 0.0, 1), ("K", 1.0, 273.15, 2), ("degF", 1.8, 32.0, 1)]
            }
            Quantity::WheelSlide => &[("1", 1.0, 0.0, 0)],
        }
    }

    /// Column names in several houses' styles; `{u}` stands for the unit.
    const fn names(self) -> [&'static str; 5] {
        match self {
            Quantity::Time => ["time_{u}", "Time [{u}]", "zeit", "t", "timestamp"],
            Quantity::Position => ["position_{u}", "Chainage [{u}]", "weg", "s", "odo"],
            Quantity::Speed => ["speed_{u}", "Speed [{u}]", "v_ist", "v", "velocity"],
            Quantity::TractionForce => {
                ["traction_{u}", "Tractive effort [{u}]", "f_zug", "te", "tractionForce"]
            }
            Quantity::BrakeForce => {
                ["braking_{u}", "Brake effort [{u}]", "f_brems", "be", "brakeForce"]
            }
            Quantity::ControlForce => {
                ["control_{u}", "Wheel rim force [{u}]", "f_rad", "f", "controlForce"]
            }
            Quantity::Pressure => {
                ["cylinder_{u}", "BC pressure [{u}]", "p_c", "bcp", "brakePressure"]
            }
            Quantity::Temperature => {
                ["outside_{u}", "Outside temp [{u}]", "t_aussen", "oat", "ambient"]
            }
            Quantity::WheelSlide => ["slide", "Wheel slide", "gleiten", "ws", "wheelSlide"],
        }
    }
}

/// A column of the run files.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What it holds.
    pub quantity: Quantity,
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
        has_odometer || self.quantity != Quantity::Position
    }

    /// The file's text for an SI value.
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
pub fn make_style(extra_decimals: usize, random: &mut Random) -> FileStyle {
    let house = random.integer(0, 4);
    let has_control_force = random.chance(0.2);
    let mut quantities = vec![Quantity::Time, Quantity::Position, Quantity::Speed];
    if has_control_force {
        quantities.push(Quantity::ControlForce);
    } else {
        quantities.extend([Quantity::TractionForce, Quantity::BrakeForce]);
    }
    quantities.extend([Quantity::Pressure, Quantity::Temperature]);
    if random.chance(0.4) {
        quantities.push(Quantity::WheelSlide);
    }
    let columns = quantities
        .into_iter()
        .map(|quantity| {
            let (unit, per_si, addend, decimals) = random.pick(quantity.units());
            // Some loggers write raw counts of a thousandth.
            let is_raw = quantity == Quantity::Pressure && random.chance(0.25);
            let (scale, decimals) =
                if is_raw { (1e-3, 0) } else { (1.0, decimals + extra_decimals) };
            let is_whole = matches!(quantity, Quantity::Time | Quantity::WheelSlide);
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

/// One row of a run file; what is missing is an empty cell.
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
            Quantity::Time => Some(sample.time_ns as f64 * 1e-9),
            Quantity::Position => sample.get(SampleField::Position).map(|centre| centre + head_m),
            Quantity::Speed => sample.get(SampleField::Speed),
            Quantity::TractionForce => sample.get(SampleField::TractionForce),
            Quantity::BrakeForce => sample.get(SampleField::BrakeForce),
            Quantity::ControlForce => control_force_n(sample),
            Quantity::Pressure => sample.get(SampleField::BrakeCylinderPressure),
            Quantity::Temperature => sample.get(SampleField::AmbientTemperature),
            Quantity::WheelSlide => Some(f64::from(sample.flags & 1)),
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
