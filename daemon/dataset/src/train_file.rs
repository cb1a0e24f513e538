//! `train.toml`.

use std::ops::RangeInclusive;

use dynocar_model::terms::{Key, curve, extra, rotating, tunnel};
use dynocar_model::train::{BrakeGear, Corrections, Davis, EffortCurve, PowerTrain, TrainModel};

use super::corrections::{read_corrections, read_extra};
use super::document::{Item, above_zero};
use super::error::DatasetError;
use super::friction_brake::{UNIT_STDS, components, friction_brake};
use super::node::Node;

/// k in the declared curve resistance k/R in N/kN, R in m, unless a train says otherwise.
pub const CURVE_CONSTANT_DEFAULT_N_PER_KN_M: f64 = 600.0;
/// Mass of a passenger in kg unless a train says otherwise.
pub const PASSENGER_MASS_DEFAULT_KG: f64 = 70.0;
#[rustfmt::skip]
const BRAKE_KEYS: [&str; 18] = [
    "max_force_kn", "effort", "cylinder_diameter_mm", "disc_radius_mm", "wheel_radius_mm", "efficiency",
    "ratio", "friction", "pads", "force_per_pressure_n_per_pa", "release_pressure_pa", "units",
    "failure_probability", UNIT_STDS[0], UNIT_STDS[1], UNIT_STDS[2], UNIT_STDS[3], UNIT_STDS[4],
];
/// Which masses a train and a run of it may have.
pub(super) const MASS: &str = "a mass in t above 0, at most 100000";

/// Reads the text of a `train.toml`; `label` names the file in messages.
///
/// # Errors
///
/// Names file, line, key, value and what was allowed. Unknown keys are refused.
///
/// # Examples
///
/// ```
/// use dynocar_dataset::parse_train;
///
/// let declared = "[train]\nmass_t = 200\nlength_m = 100\nrotating_mass_factor = 0.06\n\
///                 [resistance]\na = 1.5\nb = 0.01\nc = 0.0005\n";
/// let train = parse_train("train.toml", declared)?;
/// assert_eq!(train.mass_kg, 200_000.0);
/// let error = parse_train("train.toml", &declared.replace("200", "-200")).unwrap_err();
/// assert!(error.to_string().contains("train.mass_t = -200"), "{error}");
/// # Ok::<(), dynocar_dataset::error::DatasetError>(())
/// ```
pub fn parse_train(label: &str, text: &str) -> Result<TrainModel, DatasetError> {
    let document = Node::of_toml(label, text)?;
    let root = Item::root(label, &document);
    root.allow(&["train", "resistance", "traction", "brake", "corrections", extra::TABLES])?;
    let train = root.need_table("train")?;
    let gamma = &rotating::FACTOR;
    let keys = ["name", "mass_t", "mass_full_t", "length_m", "cars", gamma.name];
    train.allow(&[&keys[..], &["passenger_mass_kg"]].concat())?;
    let resistance = root.need_table("resistance")?;
    let (traction, drive) = match root.table("traction")? {
        Some(section) => {
            section.allow(&[
                "effort",
                "efficiency",
                "auxiliary_power_kw",
                "power_speed_min_mps",
            ])?;
            (effort(&section)?, drive(&section)?)
        }
        None => (None, None),
    };
    let (brake, brake_gear) = match root.table("brake")? {
        Some(section) => brake(&section)?,
        None => (None, BrakeGear::default()),
    };
    let mass_t = train.required("mass_t", MASS, above_zero(1e5))?;
    let full = format!("a mass in t above mass_t, {mass_t}, at most 100000");
    let mass_full_t = train.optional("mass_full_t", &full, mass_t.next_up()..=1e5)?;
    let length_m =
        train.required("length_m", "a length in m above 0, at most 10000", above_zero(1e4))?;
    let is_count = |cars: f64| (1.0..=1000.0).contains(&cars) && cars.fract() == 0.0;
    let cars = train.checked_under("cars", "a whole number from 1 to 1000", is_count)?;
    let passenger = "a mass in kg from 0 to 200";
    let passenger_kg = train.optional("passenger_mass_kg", passenger, 0.0..=200.0)?;
    let rotating_mass_factor = train.need(gamma.name, gamma.allowed)?;
    let rotating_mass_factor =
        rotating_mass_factor.checked(gamma.allowed, |value| gamma.allows(value))?;
    let (davis, curve_constant_n_per_kn_m, tunnel_constant_n_per_kn_m) = declared(&resistance)?;
    let mut model = TrainModel {
        name: train.quoted("name")?.unwrap_or("unnamed train").into(),
        mass_kg: mass_t * 1000.0,
        full_mass_kg: mass_full_t.map(|mass_t| 1000.0 * mass_t),
        passenger_mass_kg: passenger_kg.unwrap_or(PASSENGER_MASS_DEFAULT_KG),
        length_m,
        cars: cars.unwrap_or(1.0) as u32,
        rotating_mass_factor,
        resistance: davis,
        curve_constant_n_per_kn_m,
        tunnel_constant_n_per_kn_m,
        traction,
        brake,
        drive,
        brake_gear,
        corrections: Corrections::NONE,
        extra: read_extra(&root)?,
    };
    if let Some(section) = root.table("corrections")? {
        read_corrections(&section, &mut model)?;
    }
    Ok(model)
}

/// Davis coefficients, curve constant and tunnel constant.
fn declared(section: &Item) -> Result<(Davis, f64, f64), DatasetError> {
    section.allow(&["a", "b", "c", curve::CONSTANT.name, tunnel::CONSTANT.name])?;
    // Fitted coefficients may be negative one by one; forces in N instead of N/kN are far out.
    let davis = Davis {
        a: section.required("a", "N/kN, from -100 to 100", -100.0..=100.0)?,
        b: section.required("b", "N/kN per m/s, from -10 to 10", -10.0..=10.0)?,
        c: section.required("c", "N/kN per (m/s)², from -1 to 1", -1.0..=1.0)?,
    };
    let number =
        |key: &Key| section.checked_under(key.name, key.allowed, |value| key.allows(value));
    let (curve, tunnel) = (number(&curve::CONSTANT)?, number(&tunnel::CONSTANT)?);
    Ok((davis, curve.unwrap_or(CURVE_CONSTANT_DEFAULT_N_PER_KN_M), tunnel.unwrap_or(0.0)))
}

/// The drive that is known by its electric power; `None` where nothing is declared of it.
fn drive(section: &Item) -> Result<Option<PowerTrain>, DatasetError> {
    let share = "a share from 0.3 to 1";
    let efficiency = section.optional("efficiency", share, PowerTrain::EFFICIENCIES)?;
    let power = "a power in kW from 0 to 2000";
    let auxiliary_kw = section.optional("auxiliary_power_kw", power, PowerTrain::AUXILIARIES_KW)?;
    let speed = "a speed in m/s from 0.5 to 20";
    let speed_min = section.optional("power_speed_min_mps", speed, 0.5..=20.0)?;
    if efficiency.or(auxiliary_kw).or(speed_min).is_none() {
        return Ok(None);
    }
    let usual = PowerTrain::USUAL;
    Ok(Some(PowerTrain {
        efficiency: efficiency.unwrap_or(usual.efficiency),
        auxiliary_power_w: auxiliary_kw.map_or(usual.auxiliary_power_w, |kw| 1e3 * kw),
        speed_min_mps: speed_min.unwrap_or(usual.speed_min_mps),
    }))
}

fn brake(section: &Item) -> Result<(Option<EffortCurve>, BrakeGear), DatasetError> {
    section.allow(&BRAKE_KEYS)?;
    let max_force_kn = section.optional("max_force_kn", FORCE, FORCES_KN)?;
    let curve = effort(section)?;
    if max_force_kn.is_some() && curve.is_some() {
        return Err(section.exclusive("max_force_kn", "effort"));
    }
    let constant = max_force_kn.and_then(|force| EffortCurve::new(vec![(0.0, force * 1000.0)]));
    let size =
        |key| section.optional(key, "a size in mm above 0, at most 2000", above_zero(2000.0));
    let share = |key| section.optional(key, "above 0, at most 1", above_zero(1.0));
    let gear = BrakeGear {
        cylinder_diameter_mm: size("cylinder_diameter_mm")?,
        disc_radius_mm: size("disc_radius_mm")?,
        wheel_radius_mm: size("wheel_radius_mm")?,
        efficiency: share("efficiency")?,
        ratio: section.optional("ratio", "above 0, at most 100", above_zero(100.0))?,
        friction: share("friction")?,
        pads: section.optional("pads", "from 1 to 100000", 1.0..=1e5)?,
        friction_brake: friction_brake(section)?,
        components: components(section)?,
    };
    Ok((curve.or(constant), gear))
}

const FORCE: &str = "a force in kN from 0 to 10000";
const FORCES_KN: RangeInclusive<f64> = 0.0..=1e4;

/// The curve under `effort`, from [speed_mps, force kN].
fn effort<'t>(section: &Item<'t>) -> Result<Option<EffortCurve>, DatasetError> {
    const KEY: &str = "effort";
    let Some(entries) = section.entries::<2>(KEY, "[speed_mps, force kN]")? else {
        return Ok(None);
    };
    let point = |([speed_mps, force_kn], entry): ([f64; 2], Item<'t>)| {
        let speed_mps = entry.within(speed_mps, "a speed in m/s from 0 to 200", 0.0..=200.0)?;
        let force_kn = entry.within(force_kn, FORCE, FORCES_KN)?;
        Ok(EffortEntry { entry, speed_mps, force_n: 1000.0 * force_kn })
    };
    let points = growing(&section.full(KEY), entries.into_iter().map(point))?;
    let none = || section.key_out_of_range(KEY, "[]", "at least one [speed_mps, force kN]");
    EffortCurve::new(points).map(Some).ok_or_else(none)
}

/// A point of an effort curve, and the entry that it stands in.
pub struct EffortEntry<'t> {
    /// The entry.
    pub entry: Item<'t>,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Force in N.
    pub force_n: f64,
}

/// Returns the points of an effort curve, (m/s, N), whose speeds must grow; `key` names the curve.
///
/// # Errors
///
/// At the first that does not follow the one before it.
pub fn growing<'t>(
    key: &str,
    points: impl Iterator<Item = Result<EffortEntry<'t>, DatasetError>>,
) -> Result<Vec<(f64, f64)>, DatasetError> {
    let mut grown: Vec<(f64, f64)> = Vec::new();
    for (index, point) in points.enumerate() {
        let EffortEntry { entry, speed_mps, force_n } = point?;
        if let Some(&(before, _)) = grown.last()
            && speed_mps <= before
        {
            return Err(entry.wrong(format!(
                "{key} entry {}: expected a speed above the one before ({before} m/s), got \
                 {speed_mps} m/s",
                index + 1
            )));
        }
        grown.push((speed_mps, force_n));
    }
    Ok(grown)
}

#[cfg(test)]
mod tests {
    use dynocar_model::train::{BrakeComponents, FrictionBrake};

    use super::*;

    const FULL: &str = r#"
[train]
name = "CRH380C 8M8T"
mass_t = 981.7
length_m = 400.47
cars = 16
rotating_mass_factor = 0.06
[resistance]
a = 0.79
b = 0.0229
c = 0.001493
curve_constant_n_per_kn_m = 500
tunnel_constant_n_per_kn_m = 0.00013
[traction]
effort = [[0.0, 300.0], [33.3, 300], [97.2, 110.0]]
[brake]
max_force_kn = 360.0
cylinder_diameter_mm = 203
disc_radius_mm = 297.0
wheel_radius_mm = 460.0
efficiency = 0.9
ratio = 2.55
friction = 0.28
pads = 95
force_per_pressure_n_per_pa = 0.25
release_pressure_pa = 21000.0
units = 24
friction_std = 0.05
failure_probability = 0.001
"#;

    fn refusal(text: &str) -> String {
        parse_train("train.toml", text).unwrap_err().to_string()
    }

    #[test]
    fn every_key_is_read_into_si() {
        let train = parse_train("train.toml", FULL).unwrap();
        assert_eq!((train.name.as_str(), train.cars), ("CRH380C 8M8T", 16));
        assert_eq!((train.mass_kg, train.length_m), (981_700.0, 400.47));
        assert_eq!(train.resistance, Davis { a: 0.79, b: 0.0229, c: 0.001493 });
        assert_eq!(train.rotating_mass_factor, 0.06);
        assert_eq!(train.curve_constant_n_per_kn_m, 500.0);
        assert_eq!(train.tunnel_constant_n_per_kn_m, 0.00013);
        let points = [(0.0, 300e3), (33.3, 300e3), (97.2, 110e3)];
        assert_eq!(train.traction.unwrap().points(), points);
        assert_eq!(train.brake.unwrap().force_n(50.0), 360e3);
        let gear = BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.0),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.9),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            friction_brake: Some(FrictionBrake {
                force_per_pressure_n_per_pa: 0.25,
                release_pressure_pa: 21e3,
            }),
            components: Some(BrakeComponents {
                units: 24,
                friction_std: 0.05,
                failure_probability: 0.001,
                ..BrakeComponents::default()
            }),
        };
        assert_eq!(train.brake_gear, gear);
    }

    #[test]
    fn what_has_a_default_may_be_absent() {
        let text = "[train]\nmass_t = 10\nlength_m = 1\nrotating_mass_factor = 0\n\
                    [resistance]\na = 1\nb = 0\nc = 0\n";
        let train = parse_train("train.toml", text).unwrap();
        assert_eq!(train.curve_constant_n_per_kn_m, 600.0);
        assert_eq!(train.tunnel_constant_n_per_kn_m, 0.0);
        assert_eq!((train.traction, train.brake, train.cars), (None, None, 1));
    }

    #[test]
    fn a_misspelt_key_is_refused_with_line_and_choices() {
        let message = refusal(&FULL.replace("length_m", "lenght_m"));
        assert_eq!(
            message,
            "train.toml:5: unknown key 'lenght_m' in [train]; did you mean 'length_m'? (choices: \
             'name', 'mass_t', 'mass_full_t', 'length_m', 'cars', 'rotating_mass_factor', \
             'passenger_mass_kg')"
        );
        let message = refusal(&FULL.replace("[traction]", "[tractive]"));
        assert!(message.starts_with("train.toml:14: unknown key 'tractive'; did you mean"));
    }

    #[test]
    fn values_out_of_range_or_of_another_type_are_named() {
        let cases = [
            (
                ("mass_t = 981.7", "mass_t = -3"),
                "train.toml:4: train.mass_t = -3: expected a mass in t above 0, at most 100000",
            ),
            (
                ("mass_t = 981.7", "mass_t = \"heavy\""),
                "train.toml:4: train.mass_t: expected a mass in t above 0, at most 100000, got the \
                 text \"heavy\"",
            ),
            (
                ("a = 0.79", "a = 3947.6"),
                "train.toml:9: resistance.a = 3947.6: expected N/kN, from -100 to 100",
            ),
            (
                ("cars = 16", "cars = 1.5"),
                "train.toml:6: train.cars = 1.5: expected a whole number from 1 to 1000",
            ),
            (
                ("c = 0.001493", "c = nan"),
                "train.toml:11: resistance.c = NaN: expected N/kN per (m/s)², from -1 to 1",
            ),
            (
                ("[97.2, 110.0]", "[97.2, 110.0, 3]"),
                "train.toml:15: traction.effort entry 3: expected [speed_mps, force kN], finite \
                 numbers, got [97.2, 110.0, 3]",
            ),
            (
                ("[97.2, 110.0]", "[30.0, 110.0]"),
                "train.toml:15: traction.effort entry 3: expected a speed above the one before \
                 (33.3 m/s), got 30 m/s",
            ),
            (
                ("[97.2, 110.0]", "[97.2, -1]"),
                "train.toml:15: traction.effort entry 3 = -1: expected a force in kN from 0 to \
                 10000",
            ),
            (
                ("friction = 0.28", "effort = [[0, 1]]"),
                "train.toml:17: brake.max_force_kn and brake.effort exclude each other: give one \
                 of them",
            ),
        ];
        for ((from, to), expected) in cases {
            assert_eq!(refusal(&FULL.replace(from, to)), expected);
        }
    }

    #[test]
    fn what_is_missing_is_named_with_its_table() {
        assert_eq!(refusal("x = 1\n"), refusal("x = 1"));
        assert_eq!(refusal(""), "train.toml: missing key train: expected a table");
        assert_eq!(
            refusal(&FULL.replace("rotating_mass_factor = 0.06\n", "")),
            "train.toml:2: missing key train.rotating_mass_factor: expected a rotating-mass factor \
             from 0 to 1"
        );
    }

    #[test]
    fn broken_toml_is_named_with_its_line() {
        let message = refusal("[train]\nmass_t = = 3\n");
        assert!(message.starts_with("train.toml:2: not valid TOML: "), "{message}");
        assert!(refusal("[train]\nname = 1\nname = 2\n").contains("train.toml:3: not valid TOML"));
    }
}
