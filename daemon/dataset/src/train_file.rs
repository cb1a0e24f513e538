//! Reader of `train.toml`.

use dynocar_model::train::numbers::{BRAKE_UNITS, FORCE_PER_PRESSURE, FULL_MASS};
use dynocar_model::train::{EffortCurve, NumberRule, TrainModel};

use super::corrections::read_extra;
use super::document::Item;
use super::error::DatasetError;
use super::keys::{self, FileKey, TRAIN_TABLES};
use super::node::Node;

/// Name of a train that nobody named.
const UNNAMED: &str = "unnamed train";
/// Full load over tare beyond which one of them is in another unit: a loaded hopper is four times its tare.
const FULL_OVER_TARE_MAX: f64 = 8.0;

/// Reads the text of a `train.toml`; `label` names the file in messages.
///
/// # Errors
///
/// Names file, line, key, value and the allowed values. Unknown keys are refused.
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
    root.allow(&TRAIN_TABLES)?;
    let mut model = TrainModel { name: UNNAMED.into(), ..TrainModel::UNDECLARED };
    let train = root.need_table(keys::train::TABLE)?;
    read_numbers(&train, keys::train::TABLE, keys::train::KEYS, &mut model)?;
    if let Some(name) = keys::train::NAME.quoted(&train)? {
        model.name = name.into();
    }
    if let Some(full_kg) = model.full_mass_kg
        && !(full_kg > model.mass_kg && full_kg <= FULL_OVER_TARE_MAX * model.mass_kg)
    {
        let key = FileKey::from(&FULL_MASS);
        return Err(key.refused(&train, full_kg / key.rule.factor));
    }
    let resistance = root.need_table(keys::resistance::TABLE)?;
    read_numbers(&resistance, keys::resistance::TABLE, keys::resistance::KEYS, &mut model)?;
    if let Some(section) = root.table(keys::traction::TABLE)? {
        read_numbers(&section, keys::traction::TABLE, keys::traction::KEYS, &mut model)?;
        model.traction = effort(&section, &keys::traction::EFFORT)?;
    }
    if let Some(section) = root.table(keys::brake::TABLE)? {
        read_numbers(&section, keys::brake::TABLE, keys::brake::KEYS, &mut model)?;
        read_brake(&section, &mut model)?;
    }
    if let Some(section) = root.table(keys::corrections::TABLE)? {
        read_numbers(&section, keys::corrections::TABLE, keys::corrections::KEYS, &mut model)?;
    }
    model.extra = read_extra(&root)?;
    Ok(model)
}

/// Reads the numbers of a table into a train; `others` are the other keys that the table may hold.
fn read_numbers(
    section: &Item,
    table: &str,
    others: &[FileKey],
    train: &mut TrainModel,
) -> Result<(), DatasetError> {
    let numbers = || keys::numbers_of(table);
    let all: Vec<FileKey> = others.iter().copied().chain(numbers().map(FileKey::from)).collect();
    keys::allow(section, &all)?;
    for key in numbers() {
        if let Some(value) = FileKey::from(key).number(section)? {
            key.set(train, value);
        }
    }
    Ok(())
}

/// Reads the entries of a brake that are no single number, and requires the entries that its numbers need.
fn read_brake(section: &Item, train: &mut TrainModel) -> Result<(), DatasetError> {
    let (most, curve) = (keys::brake::MAX_FORCE, keys::brake::EFFORT);
    let most_kn = most.number(section)?;
    train.brake = effort(section, &curve)?;
    if most_kn.is_some() && train.brake.is_some() {
        return Err(section.exclusive(most.name, curve.name));
    }
    if let Some(force_kn) = most_kn {
        train.brake = EffortCurve::new(vec![(0.0, 1000.0 * force_kn)]);
    }
    let gear = &mut train.brake_gear;
    // A release pressure alone says no force.
    gear.friction_brake = gear.friction_brake.filter(|_| section.has(FORCE_PER_PRESSURE.name));
    if gear.components.is_some() {
        section.need(BRAKE_UNITS.name, BRAKE_UNITS.rule.allowed)?;
    }
    Ok(())
}

/// Returns the curve under `effort`, from [speed_mps, force kN].
fn effort<'t>(section: &Item<'t>, key: &FileKey) -> Result<Option<EffortCurve>, DatasetError> {
    let Some(entries) = key.entries::<2>(section)? else { return Ok(None) };
    let point = |([speed_mps, force_kn], entry): ([f64; 2], Item<'t>)| {
        let speed_mps = entry.within(speed_mps, &SPEED_MPS)?;
        let force_kn = entry.within(force_kn, &keys::FORCE_KN)?;
        Ok(EffortEntry { entry, speed_mps, force_n: 1000.0 * force_kn })
    };
    let points = growing(&section.full(key.name), entries.into_iter().map(point))?;
    let none =
        || section.key_out_of_range(key.name, "[]", &format!("at least one {}", key.rule.allowed));
    EffortCurve::new(points).map(Some).ok_or_else(none)
}

const SPEED_MPS: NumberRule = NumberRule::within(0.0, 200.0, "a speed in m/s from 0 to 200");

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
    use dynocar_model::train::{BrakeComponents, BrakeGear, Davis, FrictionBrake};

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
