//! What recorders call the quantities, in several languages.

use crate::Quantity;

/// How far a term can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermWeight {
    /// Says the quantity among other words too.
    Named,
    /// Says it where nothing else of weight is said: `brake` may go on as `brake disc wear`.
    Alone,
    /// A letter of formulas or an abbreviation.
    Symbol,
    /// May well be another thing's: a train has more pressures than one.
    Weak,
}

/// What quantities are called: what the terms are worth, and the terms, separated by commas. The
/// name of a quantity comes on top.
const TERMS: &[(Quantity, TermWeight, &str)] = {
    use Quantity::*;
    use TermWeight::{Alone, Named, Symbol, Weak};
    &[
        (
            Time,
            Named,
            "time, timestamp, time stamp, zeit, zeitstempel, laufzeit, uhrzeit, temps, tiempo",
        ),
        (Time, Alone, "datetime, date time, elapsed, seconds, sekunden, epoch, utc, clock, ts"),
        (Time, Symbol, "t"),
        (
            Position,
            Named,
            "chainage, odometer, kilometrage, streckenkilometer, wegstrecke, line position",
        ),
        (Position, Named, "track position, distance travelled, distance"),
        (
            Position,
            Alone,
            "position, pos, weg, strecke, odo, mileage, station, pk, km, kilometer, way, dist",
        ),
        (Position, Symbol, "s, x"),
        (Speed, Named, "speed, velocity, geschwindigkeit, vitesse, velocidad, velocita, hastighet"),
        (Speed, Alone, "v ist, v act, v train, v zug, v gps, tacho, spd, vel, vist, vact"),
        (Speed, Symbol, "v"),
        (Acceleration, Named, "acceleration, beschleunigung, dv dt, dvdt"),
        (Acceleration, Alone, "accel, acc"),
        (Acceleration, Symbol, "a"),
        (SpecificForce, Named, "accelerometer, imu ax, acc sensor"),
        (
            TractionForce,
            Named,
            "tractive force, tractive effort, traction effort, zugkraft, antriebskraft",
        ),
        (
            TractionForce,
            Named,
            "effort de traction, driving force, propulsion force, pulling force",
        ),
        (
            TractionForce,
            Alone,
            "traction, f trac, f traction, f zug, f t, f tr, f z, f drive, ftrac, tractive",
        ),
        (TractionForce, Symbol, "te, zk, ft, fz"),
        (
            BrakeForce,
            Named,
            "braking force, brake effort, braking effort, bremskraft, retarding force",
        ),
        (BrakeForce, Named, "effort de freinage"),
        (
            BrakeForce,
            Alone,
            "brake, braking, brk, f b, f br, f brake, f brems, f brk, fbrake, bremse, freinage",
        ),
        (BrakeForce, Symbol, "be, bk, fb, fbr"),
        (
            ControlForce,
            Named,
            "wheel rim force, zug bremskraft, tractive and braking effort, net force",
        ),
        (ControlForce, Named, "zug und bremskraft, traction brake force, traction braking effort"),
        (
            ControlForce,
            Alone,
            "force, kraft, effort, control, f rad, f ctrl, f wheel, f total, te be, radkraft",
        ),
        (ControlForce, Symbol, "f"),
        (
            TractionHandle,
            Named,
            "throttle, fahrschalter, fahrhebel, power handle, master controller, power notch",
        ),
        (TractionHandle, Alone, "notch"),
        (BrakeHandle, Named, "brake lever, brake notch, bremshebel, brake demand, brake command"),
        (
            BrakeCylinderPressure,
            Named,
            "bc pressure, cylinder pressure, bremszylinderdruck, zylinderdruck, c druck",
        ),
        (
            BrakeCylinderPressure,
            Named,
            "pression cylindre, pression cf, brake cyl pressure, bremszylinder druck",
        ),
        (
            BrakeCylinderPressure,
            Alone,
            "brake pressure, bremsdruck, p bc, p cyl, p c, p bz, p brake, cylinder, cyl, brakepressure",
        ),
        (BrakeCylinderPressure, Symbol, "bcp, pbc"),
        (BrakeCylinderPressure, Weak, "pressure, druck, p"),
        (
            TrainMass,
            Named,
            "gross mass, zugmasse, gesamtmasse, zuggewicht, train weight, gross weight",
        ),
        (TrainMass, Alone, "mass, weight, masse, gewicht, m train, m zug"),
        (TrainMass, Symbol, "m"),
        (
            Passengers,
            Named,
            "passenger count, number of passengers, numberofpassengers, fahrgaeste, reisende",
        ),
        (Passengers, Alone, "pax, passenger, persons"),
        (
            AmbientTemperature,
            Named,
            "outside temperature, outside temp, outdoor temperature, air temperature",
        ),
        (
            AmbientTemperature,
            Named,
            "aussentemperatur, aussentemp, temperature ext, umgebungstemperatur, lufttemperatur, ambient temp, oat",
        ),
        (
            AmbientTemperature,
            Alone,
            "temperature, temp, temperatur, outside, ambient, amb, t amb, t out, t aussen, t air",
        ),
        (RelativeHumidity, Named, "humidity, luftfeuchte, luftfeuchtigkeit, rel humidity"),
        (RelativeHumidity, Symbol, "rh"),
        (Gradient, Named, "slope, neigung, steigung, laengsneigung, incline, inclination, pente"),
        (Gradient, Alone, "grade, rampe, grad"),
        (Gradient, Symbol, "i"),
        (Altitude, Named, "elevation, hoehe, meereshoehe, height above sea"),
        (Altitude, Alone, "alt, elev, height, gps alt"),
        (Altitude, Symbol, "z, h"),
        (
            CurveRadius,
            Named,
            "bogenradius, kurvenradius, gleisradius, radius of curve, track radius",
        ),
        (CurveRadius, Alone, "radius, rayon"),
        (CurveRadius, Symbol, "r"),
        (WindSpeed, Named, "windgeschwindigkeit, wind velocity"),
        (WindSpeed, Alone, "wind, v wind"),
        (
            WheelSlide,
            Named,
            "wheel slip, enrayage, gleitschutz, wheelslide, wheelslip, wheel slide protection",
        ),
        (WheelSlide, Alone, "slide, slip, gleiten, schleudern, wsp, wsp active"),
        (WheelSlide, Symbol, "ws"),
        (Latitude, Named, "breitengrad"),
        (Latitude, Alone, "lat, gps lat, gnss lat, breite"),
        (Longitude, Named, "laengengrad"),
        (Longitude, Alone, "lon, lng, long, gps lon, gnss lon, laenge"),
        (Course, Named, "heading, course over ground"),
        (Course, Alone, "cog, kurs"),
        (Curvature, Named, "kruemmung, gleiskruemmung"),
        (DoorOpen, Named, "doors open, door is open, tuer offen, tueren offen, dooropen"),
        (DoorOpen, Alone, "door, doors"),
        (TractionPower, Named, "motor power, antriebsleistung, traktionsleistung, tractive power"),
        (TractionPower, Alone, "p trac, p traction"),
        (
            LinePower,
            Named,
            "pantograph power, catenary power, grid power, oberleitungsleistung, netzleistung",
        ),
        (LinePower, Alone, "p line, p panto"),
        (
            LineVoltage,
            Named,
            "pantograph voltage, catenary voltage, oberleitungsspannung, fahrdrahtspannung, netzspannung",
        ),
        (LineVoltage, Alone, "u line, u panto"),
        (LineCurrent, Named, "pantograph current, catenary current, oberleitungsstrom, netzstrom"),
        (LineCurrent, Alone, "i line, i panto"),
    ]
};

/// What a quantity is called besides its name, and what each term is worth.
pub fn terms(quantity: Quantity) -> impl Iterator<Item = (TermWeight, &'static str)> {
    let own = TERMS.iter().filter(move |(of, ..)| *of == quantity);
    own.flat_map(|&(_, strength, list)| list.split(", ").map(move |term| (strength, term)))
}

/// Words that change nothing of what a column is.
pub const NEUTRAL: &[&str] = &[
    "train", "zug", "vehicle", "fahrzeug", "ist", "act", "actual", "measured", "mess", "gemessen",
    "value", "wert", "istwert", "sensor", "signal", "avg", "mean", "filtered", "filt", "raw",
    "total", "sum", "ges", "gesamt", "log", "data", "the", "of", "de", "du", "la", "in", "rel",
    "gps", "gnss", "since", "start", "recorded", "own", "mvb", "wtb", "can", "tcms", "tcu", "bcu",
    "vcu", "dcu",
];

/// Words of what was wanted or allowed instead of what was measured.
pub const NOT_MEASURED: &[&str] = &[
    "soll",
    "sollwert",
    "set",
    "setpoint",
    "target",
    "ziel",
    "demand",
    "demanded",
    "ref",
    "reference",
    "limit",
    "max",
    "maximum",
    "min",
    "minimum",
    "allowed",
    "permitted",
    "erlaubt",
    "zul",
    "zulaessig",
    "consigne",
    "command",
    "cmd",
    "desired",
    "planned",
    "plan",
    "schedule",
    "forecast",
    "hoechst",
];

/// Words of what is said of a measurement instead of it.
pub const ABOUT: &[&str] = &[
    "error", "quality", "status", "valid", "validity", "accuracy", "sigma", "stddev", "id", "name",
    "type", "number", "nr", "flag",
];

/// Words of things that have a temperature, a pressure, a speed … of their own.
pub const OTHER_THINGS: &[&str] = &[
    "motor",
    "motors",
    "engine",
    "oil",
    "oel",
    "bearing",
    "lager",
    "disc",
    "disk",
    "scheibe",
    "inside",
    "indoor",
    "innen",
    "coolant",
    "kuehl",
    "kuehlmittel",
    "kuehlwasser",
    "battery",
    "batterie",
    "transformer",
    "trafo",
    "converter",
    "umrichter",
    "cabin",
    "gear",
    "gearbox",
    "getriebe",
    "inverter",
    "pipe",
    "leitung",
    "hauptluftleitung",
    "reservoir",
    "behaelter",
    "tyre",
    "fan",
    "luefter",
    "spring",
    "bellows",
    "supply",
    "compressor",
    "valve",
    "room",
    "interior",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_term_belongs_to_one_quantity_and_is_written_as_names_are_folded() {
        let mut seen: Vec<(&str, Quantity)> = Vec::new();
        for quantity in Quantity::ALL {
            assert!(terms(quantity).next().is_some(), "{quantity}");
            for (_, term) in terms(quantity) {
                let is_folded = |letter: char| letter.is_ascii_lowercase() || letter == ' ';
                assert!(!term.is_empty() && term.chars().all(is_folded), "{quantity}: {term:?}");
                let twin = seen.iter().find(|(other, _)| *other == term);
                assert_eq!(twin, None, "{quantity}: {term} again");
                seen.push((term, quantity));
            }
        }
        for quantity in Quantity::ALL {
            let twin = seen.iter().find(|(term, _)| *term == quantity.name().replace('_', " "));
            assert!(twin.is_none_or(|(_, of)| *of == quantity), "{quantity}");
        }
    }
}
