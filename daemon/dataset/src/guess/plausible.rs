//! Unit in which a column's values are those of a train.

use dynocar_model::units::Unit;

use super::facts::Facts;
use super::name::{Measure, Usual, usual};
use crate::Quantity;

/// Factor beyond the usual values above which values are not of a quantity in a unit.
const FAR: f64 = 20.0;
/// Some 3000 years in s.
const TIME_MAX_S: f64 = 1e11;
/// Julian days from 1858 to 2132, which count from before the year 0.
const JULIAN_DAYS: std::ops::Range<f64> = 2.4e6..2.5e6;
/// The factor of recorders that write counts of a thousandth.
const RAW_COUNT: f64 = 1e-3;

/// A unit for a column, with its reason and any doubt.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitChoice {
    /// The unit of `cell * scale`.
    pub unit: Unit,
    /// Factor on the cell.
    pub scale: f64,
    /// Reason for it.
    pub reason: String,
    /// Doubt about it; `None` where the header states it and the values agree.
    pub doubt: Option<String>,
}

impl Usual {
    /// Returns the figure that reveals a column's unit, with its description in words; `None` where it reveals nothing.
    fn figure(&self, facts: &Facts) -> Option<(f64, String)> {
        let (words, figure) = match self.measure {
            Measure::Top => ("values up to", facts.top()),
            Measure::Middle => ("values about", facts.middle()),
            Measure::Step => ("steps of", facts.step()),
            Measure::Span => ("values over", facts.span()),
        };
        let figure = figure.filter(|figure| *figure != 0.0)?;
        Some((figure, format!("{words} {}", number(figure))))
    }

    /// Returns the distance of a value in the base unit from the usual range, as a factor's logarithm; 0 within the
    /// range.
    fn distance(&self, base: f64) -> f64 {
        if (self.low..=self.high).contains(&base) {
            return 0.0;
        }
        if self.low <= 0.0 || base <= 0.0 {
            let room = self.high - self.low;
            return ((self.low - base).max(base - self.high) / room + 1.0).ln();
        }
        (self.low / base).max(base / self.high).ln()
    }
}

/// Returns the unit of a column: the one that its name gives, else the likeliest by its values.
pub fn choose_unit(quantity: Quantity, facts: &Facts, named: Option<Unit>) -> UnitChoice {
    let shown = usual(quantity).and_then(|usual| Some((usual, usual.figure(facts)?)));
    match (named, shown) {
        (Some(unit), None) => said(unit),
        (Some(unit), Some((usual, figure))) => judge(unit, usual, figure),
        (None, Some((usual, figure))) => by_values(quantity, usual, figure, facts.max),
        (None, None) => {
            let unit = quantity.unit();
            let counts = unit.name() == "1";
            let doubt = (!counts).then(|| format!("the name gives no unit; {}", unit.name()));
            UnitChoice { unit, scale: 1.0, reason: "the unit that is usual".into(), doubt }
        }
    }
}

fn said(unit: Unit) -> UnitChoice {
    UnitChoice { unit, scale: 1.0, reason: "the unit that the name gives".into(), doubt: None }
}

/// Returns whether values can be in the unit that the name gives.
fn judge(unit: Unit, usual: &Usual, (figure, words): (f64, String)) -> UnitChoice {
    let base = |scale: f64| unit.to_base(figure * scale);
    let distance = usual.distance(base(1.0));
    if distance <= FAR.ln() {
        return said(unit);
    }
    let name = unit.name();
    if distance > 100.0_f64.ln() && usual.distance(base(RAW_COUNT)) == 0.0 {
        let doubt = format!("{words} are no {name} of a train; read as thousandths of {name}");
        return UnitChoice { doubt: Some(doubt), scale: RAW_COUNT, ..said(unit) };
    }
    let doubt = format!("{words} are unusual in {name}, the unit that the name gives");
    UnitChoice { doubt: Some(doubt), ..said(unit) }
}

/// Returns the likeliest unit where the name gives none.
fn by_values(
    quantity: Quantity,
    usual: &Usual,
    (figure, words): (f64, String),
    max: f64,
) -> UnitChoice {
    let units = usual.units.iter().filter_map(|name| Unit::find(quantity.dimension(), name));
    // No other clock counts longer than from the year 0.
    let is_clock =
        |it: &Unit| it.to_base(max) < TIME_MAX_S || it.name() == "d" && JULIAN_DAYS.contains(&max);
    let units = units.filter(|it| quantity != Quantity::Time || is_clock(it));
    let mut fits: Vec<(f64, Unit)> =
        units.map(|unit| (usual.distance(unit.to_base(figure)), unit)).collect();
    // Stable: of units that fit alike, the likelier comes first.
    fits.sort_by(|one, other| one.0.total_cmp(&other.0));
    let (distance, unit) = fits.first().copied().unwrap_or((0.0, quantity.unit()));
    let mut others: Vec<&str> = fits[1.min(fits.len())..]
        .iter()
        .filter(|(distance, _)| *distance <= 3.0_f64.ln())
        .map(|(_, unit)| unit.name())
        .collect();
    let name = unit.name();
    // Simulators write angles, which look like shares.
    others.extend((quantity == Quantity::Gradient && name == "%").then_some("deg"));
    let doubt = match (distance == 0.0, others.is_empty()) {
        (false, _) => format!("the name gives no unit, and {words} are usual in none; {name}?"),
        (true, true) => format!("the name gives no unit; {words} are {name} for a train"),
        (true, false) => format!(
            "the name gives no unit; {words} are taken for {name}, but could be {}",
            others.join(" or ")
        ),
    };
    let reason = format!("{words} are usual in {name}");
    UnitChoice { unit, scale: 1.0, reason, doubt: Some(doubt) }
}

/// Returns a number in few letters.
fn number(value: f64) -> String {
    let size = value.abs();
    if !(0.01..1e6).contains(&size) {
        return format!("{value:.1e}");
    }
    let decimals = (2 - size.log10().floor() as i32).clamp(0, 4) as usize;
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the values from 0 up to a top.
    fn ramp(top: f64) -> Facts {
        let mut facts = Facts::new();
        (0..=100).for_each(|row| facts.push(f64::from(row) * top / 100.0));
        facts
    }

    fn unit_of(quantity: Quantity, top: f64) -> (&'static str, Option<String>) {
        let choice = choose_unit(quantity, &ramp(top), None);
        (choice.unit.name(), choice.doubt)
    }

    #[test]
    fn the_likeliest_unit_is_taken_by_the_range_of_values_and_said_to_be_a_guess() {
        use Quantity::*;
        let cases = [
            (Speed, 120.0, "km/h"),
            (Speed, 305.0, "km/h"),
            (Speed, 33.0, "m/s"),
            (TractionForce, 300.0, "kN"),
            (TractionForce, 300_000.0, "N"),
            (BrakeForce, 0.4, "MN"),
            (BrakeCylinderPressure, 3.8, "bar"),
            (BrakeCylinderPressure, 380.0, "kPa"),
            (BrakeCylinderPressure, 380_000.0, "Pa"),
            (TrainMass, 114.5, "t"),
            (TrainMass, 114_500.0, "kg"),
            (Position, 25_000.0, "m"),
            (Position, 25.0, "km"),
            (Gradient, 12.5, "permille"),
            (Gradient, 1.2, "%"),
            (Gradient, 0.0125, "1"),
            (TractionHandle, 1.0, "1"),
            (TractionHandle, 100.0, "%"),
            (TractionPower, 4000.0, "kW"),
            (TractionPower, 4e6, "W"),
        ];
        for (quantity, top, expected) in cases {
            let (unit, doubt) = unit_of(quantity, top);
            assert_eq!(unit, expected, "{quantity} up to {top}");
            assert!(doubt.is_some(), "{quantity} up to {top}: a guess is said to be one");
        }
        let (_, doubt) = unit_of(Speed, 33.0);
        assert!(doubt.unwrap().contains("could be km/h"));
    }

    #[test]
    fn time_is_reported_by_its_step_and_temperature_by_its_middle() {
        let time = |step: f64| {
            let mut facts = Facts::new();
            (0..500).for_each(|row| facts.push(1.7e9 + f64::from(row) * step));
            choose_unit(Quantity::Time, &facts, None).unit.name()
        };
        assert_eq!((time(1.0), time(0.2), time(200.0), time(2e5)), ("s", "s", "ms", "us"));
        let mut kelvin = Facts::new();
        (0..50).for_each(|row| kelvin.push(280.0 + 0.1 * f64::from(row)));
        let choice = choose_unit(Quantity::AmbientTemperature, &kelvin, None);
        assert_eq!(choice.unit.name(), "K");
    }

    #[test]
    fn a_named_unit_is_taken_and_doubted_where_no_train_has_such_values() {
        let named = |text: &str, top: f64| {
            let dimension = Quantity::BrakeCylinderPressure.dimension();
            choose_unit(Quantity::BrakeCylinderPressure, &ramp(top), Unit::spelled(dimension, text))
        };
        assert_eq!(named("bar", 3.8).doubt, None);
        let odd = named("bar", 380.0);
        assert!(odd.scale == 1.0 && odd.doubt.unwrap().contains("unusual in bar"));
        let raw = named("bar", 3800.0);
        assert!(raw.doubt.unwrap().contains("thousandths of bar"));
        assert_eq!(raw.scale, 1e-3);
    }

    #[test]
    fn a_column_of_zeros_takes_the_usual_unit() {
        let (unit, doubt) = unit_of(Quantity::Speed, 0.0);
        assert!(unit == "m/s" && doubt.is_some());
    }
}
