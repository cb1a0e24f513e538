//! What recorders call the quantities, in several languages.

use crate::dataset::Quantity;

/// How far a term can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strength {
    /// Says the quantity among other words too.
    Named,
    /// Says it where nothing else of weight is said: `brake` may go on as `brake disc wear`.
    Alone,
    /// A letter of formulas or an abbreviation.
    Symbol,
    /// May well be another thing's: a train has more pressures than one.
    Weak,
}

/// Terms of a quantity: what they are worth, and the terms, words separated by spaces.
type Terms = (Strength, &'static str);

/// What a quantity is called, terms separated by commas. Its own name comes on top.
pub const fn terms(quantity: Quantity) -> &'static [Terms] {
    use Strength::{Alone, Named, Symbol, Weak};
    match quantity {
        Quantity::Time => &[
            (
                Named,
                "time, timestamp, time stamp, zeit, zeitstempel, laufzeit, uhrzeit, temps, tiempo",
            ),
            (Alone, "datetime, date time, elapsed, seconds, sekunden, epoch, utc, clock, ts"),
            (Symbol, "t"),
        ],
        Quantity::Position => &[
            (
                Named,
                "chainage, odometer, kilometrage, streckenkilometer, wegstrecke, line position",
            ),
            (Named, "track position, distance travelled, distance"),
            (
                Alone,
                "position, pos, weg, strecke, odo, mileage, station, pk, km, kilometer, way, dist",
            ),
            (Symbol, "s, x"),
        ],
        Quantity::Speed => &[
            (Named, "speed, velocity, geschwindigkeit, vitesse, velocidad, velocita, hastighet"),
            (Alone, "v ist, v act, v train, v zug, v gps, tacho, spd, vel, vist, vact"),
            (Symbol, "v"),
        ],
        Quantity::Acceleration => &[
            (Named, "acceleration, beschleunigung, dv dt, dvdt"),
            (Alone, "accel, acc"),
            (Symbol, "a"),
        ],
        Quantity::SpecificForce => &[(Named, "accelerometer, imu ax, acc sensor")],
        Quantity::TractionForce => &[
            (Named, "tractive force, tractive effort, traction effort, zugkraft, antriebskraft"),
            (Named, "effort de traction, driving force, propulsion force, pulling force"),
            (
                Alone,
                "traction, f trac, f traction, f zug, f t, f tr, f z, f drive, ftrac, tractive",
            ),
            (Symbol, "te, zk, ft, fz"),
        ],
        Quantity::BrakeForce => &[
            (Named, "braking force, brake effort, braking effort, bremskraft, retarding force"),
            (Named, "effort de freinage"),
            (
                Alone,
                "brake, braking, brk, f b, f br, f brake, f brems, f brk, fbrake, bremse, freinage",
            ),
            (Symbol, "be, bk, fb, fbr"),
        ],
        Quantity::ControlForce => &[
            (Named, "wheel rim force, zug bremskraft, tractive and braking effort, net force"),
            (Named, "zug und bremskraft, traction brake force, traction braking effort"),
            (
                Alone,
                "force, kraft, effort, control, f rad, f ctrl, f wheel, f total, te be, radkraft",
            ),
            (Symbol, "f"),
        ],
        Quantity::TractionHandle => &[
            (
                Named,
                "throttle, fahrschalter, fahrhebel, power handle, master controller, power notch",
            ),
            (Alone, "notch"),
        ],
        Quantity::BrakeHandle => {
            &[(Named, "brake lever, brake notch, bremshebel, brake demand, brake command")]
        }
        Quantity::BrakeCylinderPressure => &[
            (Named, "bc pressure, cylinder pressure, bremszylinderdruck, zylinderdruck, c druck"),
            (Named, "pression cylindre, pression cf, brake cyl pressure, bremszylinder druck"),
            (
                Alone,
                "brake pressure, bremsdruck, p bc, p cyl, p c, p bz, p brake, cylinder, cyl, brakepressure",
            ),
            (Symbol, "bcp, pbc"),
            (Weak, "pressure, druck, p"),
        ],
        Quantity::TrainMass => &[
            (Named, "gross mass, zugmasse, gesamtmasse, zuggewicht, train weight, gross weight"),
            (Alone, "mass, weight, masse, gewicht, m train, m zug"),
            (Symbol, "m"),
        ],
        Quantity::Passengers => &[
            (
                Named,
                "passenger count, number of passengers, numberofpassengers, fahrgaeste, reisende",
            ),
            (Alone, "pax, passenger, persons"),
        ],
        Quantity::AmbientTemperature => &[
            (Named, "outside temperature, outside temp, outdoor temperature, air temperature"),
            (
                Named,
                "aussentemperatur, aussentemp, temperature ext, umgebungstemperatur, lufttemperatur, ambient temp, oat",
            ),
            (
                Alone,
                "temperature, temp, temperatur, outside, ambient, amb, t amb, t out, t aussen, t air",
            ),
        ],
        Quantity::RelativeHumidity => {
            &[(Named, "humidity, luftfeuchte, luftfeuchtigkeit, rel humidity"), (Symbol, "rh")]
        }
        Quantity::Gradient => &[
            (Named, "slope, neigung, steigung, laengsneigung, incline, inclination, pente"),
            (Alone, "grade, rampe, grad"),
            (Symbol, "i"),
        ],
        Quantity::Altitude => &[
            (Named, "elevation, hoehe, meereshoehe, height above sea"),
            (Alone, "alt, elev, height, gps alt"),
            (Symbol, "z, h"),
        ],
        Quantity::CurveRadius => &[
            (Named, "bogenradius, kurvenradius, gleisradius, radius of curve, track radius"),
            (Alone, "radius, rayon"),
            (Symbol, "r"),
        ],
        Quantity::WindSpeed => {
            &[(Named, "windgeschwindigkeit, wind velocity"), (Alone, "wind, v wind")]
        }
        Quantity::WheelSlide => &[
            (
                Named,
                "wheel slip, enrayage, gleitschutz, wheelslide, wheelslip, wheel slide protection",
            ),
            (Alone, "slide, slip, gleiten, schleudern, wsp, wsp active"),
            (Symbol, "ws"),
        ],
        Quantity::Latitude => &[(Named, "breitengrad"), (Alone, "lat, gps lat, gnss lat, breite")],
        Quantity::Longitude => {
            &[(Named, "laengengrad"), (Alone, "lon, lng, long, gps lon, gnss lon, laenge")]
        }
        Quantity::Course => &[(Named, "heading, course over ground"), (Alone, "cog, kurs")],
        Quantity::Curvature => &[(Named, "kruemmung, gleiskruemmung")],
        Quantity::DoorOpen => &[
            (Named, "doors open, door is open, tuer offen, tueren offen, dooropen"),
            (Alone, "door, doors"),
        ],
        Quantity::TractionPower => &[
            (Named, "motor power, antriebsleistung, traktionsleistung, tractive power"),
            (Alone, "p trac, p traction"),
        ],
        Quantity::LinePower => &[
            (
                Named,
                "pantograph power, catenary power, grid power, oberleitungsleistung, netzleistung",
            ),
            (Alone, "p line, p panto"),
        ],
        Quantity::LineVoltage => &[
            (
                Named,
                "pantograph voltage, catenary voltage, oberleitungsspannung, fahrdrahtspannung, netzspannung",
            ),
            (Alone, "u line, u panto"),
        ],
        Quantity::LineCurrent => &[
            (Named, "pantograph current, catenary current, oberleitungsstrom, netzstrom"),
            (Alone, "i line, i panto"),
        ],
    }
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

/// Words of what is told of a measurement instead of it.
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
            for term in terms(quantity).iter().flat_map(|(_, list)| list.split(", ")) {
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
