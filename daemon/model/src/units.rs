//! The units that quantities of files may have.
//!
//! Every unit converts to its dimension's base unit, which is SI, except °C for temperature, the unit of a sample.

/// Dimension of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// Base unit s.
    Time,
    /// Base unit m.
    Length,
    /// Base unit m/s.
    Speed,
    /// Base unit m/s2.
    Acceleration,
    /// Base unit N.
    Force,
    /// Base unit Pa.
    Pressure,
    /// Base unit kg.
    Mass,
    /// Base unit degC.
    Temperature,
    /// Base unit 1.
    Ratio,
    /// Base unit deg.
    Angle,
    /// Base unit 1/m.
    Curvature,
    /// Base unit W.
    Power,
    /// Base unit V.
    Voltage,
    /// Base unit A.
    Current,
    /// Things counted, and yes or no; base unit 1.
    Count,
}

/// A unit: base value = (value + shift) * multiply / divide.
///
/// A factor below one is kept as a divisor, so that a value written with few decimals converts
/// to the nearest double.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    name: &'static str,
    dimension: Dimension,
    shift: f64,
    multiply: f64,
    divide: f64,
    /// Spellings besides the name, in small letters and digits, separated by spaces.
    spellings: &'static str,
    /// True for a unit that recorders of trains use without saying so.
    is_usual: bool,
}

/// Newtons in a pound-force: 0.45359237 kg at 9.80665 m/s² (NIST SP 811, appendix B.8).
const POUND_FORCE_N: f64 = 4.4482216152605;
/// Joules in a kilowatt hour.
pub const J_PER_KWH: f64 = 3.6e6;
/// Metres per second in a mile per hour: 1609.344 m in 3600 s.
const MILE_PER_HOUR_MPS: f64 = 0.44704;
/// Acceleration in m/s² of a weight by its mass (NIST SP 811, appendix B.8).
const STANDARD_GRAVITY_MPS2: f64 = 9.80665;
/// Watts in a mechanical horsepower: 550 foot pounds-force in a second (NIST SP 811, appendix B.8).
const HORSEPOWER_W: f64 = 550.0 * 0.3048 * POUND_FORCE_N;

/// Lists the units by their dimension: a name, the shift that is added to a value before it is scaled, factor and divisor
/// to the base unit, and spellings in files. A `rare` unit is read where a file says it, and never guessed.
macro_rules! units {
    ($( $dimension:ident { $(
        $kind:ident $name:literal $( shift $shift:literal )? = $multiply:expr, $divide:expr; $spellings:literal
    )* } )*) => {
        static UNITS: &[Unit] = &[ $( $( Unit {
            name: $name,
            dimension: Dimension::$dimension,
            shift: 0.0 $( + $shift )?,
            multiply: $multiply,
            divide: $divide,
            spellings: $spellings,
            is_usual: units!(@$kind),
        }, )* )* ];
    };
    (@usual) => { true };
    (@rare) => { false };
}

units! {
    Time {
        usual "s" = 1.0, 1.0; "sec secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondi"
        usual "ms" = 1.0, 1e3; "msec msecs millis millisec millisecond milliseconds millisekunde millisekunden millisecondes"
        usual "us" = 1.0, 1e6; "usec usecs micros microsecond microseconds mikrosekunden"
        usual "ns" = 1.0, 1e9; "nsec nanos nanosecond nanoseconds"
        usual "min" = 60.0, 1.0; "mins minute minutes minuten"
        usual "h" = 3600.0, 1.0; "hr hrs hour hours std stunden heures"
        rare "d" = 86_400.0, 1.0; "days datenum serial"
        rare "100ns" = 1.0, 1e7; "tick ticks filetime"
    }
    Length {
        usual "m" = 1.0, 1.0; "meter meters metre metres mtr metri metros м"
        usual "km" = 1e3, 1.0; "kilometer kilometers kilometre kilometres chilometri км"
        usual "mm" = 1.0, 1e3; "millimeter millimeters millimetre millimetres"
        rare "cm" = 1.0, 1e2; "centimeter centimeters centimetre centimetres"
        rare "ft" = 0.3048, 1.0; "feet foot"
        rare "yd" = 0.9144, 1.0; "yds yard yards"
        rare "mi" = 1609.344, 1.0; "mile miles"
    }
    Speed {
        usual "m/s" = 1.0, 1.0; "mps mpers ms1 mpersec msec meterprosekunde meternprosekunde metresparseconde metrosporsegundo metrialsecondo meterpersecond meterspersecond metrepersecond metrespersecond мс"
        usual "km/h" = 1.0, 3.6; "kph kmph kmperh kmh1 kmhr kmperhour kmstd kilometerperhour kilometersperhour kilometreperhour kilometresperhour kilometerprostunde kilometernprostunde kilometresparheure kilometresheure kilometrosporhora chilometriallora chilometriorari kilometerperuur kilometertimmen quilometrosporhora кмч"
        usual "mph" = MILE_PER_HOUR_MPS, 1.0; "miph mih mileperhour milesperhour"
        rare "kn" = 1852.0, 3600.0; "kt kts knot knots knoten"
        rare "cm/s" = 1.0, 1e2; "cms cmps centimeterspersecond"
        rare "mm/s" = 1.0, 1e3; "mms mmps millimeterspersecond"
        rare "dm/s" = 1.0, 10.0; "dms decimeterspersecond"
        rare "m/min" = 1.0, 60.0; "mmin mpermin metersperminute metresperminute"
        rare "ft/s" = 0.3048, 1.0; "fts fps ftpersec feetpersecond"
    }
    Acceleration {
        usual "m/s2" = 1.0, 1.0; "mps2 mss mpss mpers2 ms msec2 ms2 meterspersecondsquared metrespersecondsquared meterpersecondsquared meterspersecond2"
        rare "g" = STANDARD_GRAVITY_MPS2, 1.0; "gn gee standardgravity"
        rare "mg" = STANDARD_GRAVITY_MPS2, 1e3; "milligee"
        rare "cm/s2" = 1.0, 1e2; "cms2 gal centimeterspersecondsquared"
        rare "km/h/s" = 1.0, 3.6; "kmhs kmphps kmphs kphs"
        rare "mph/s" = MILE_PER_HOUR_MPS, 1.0; "mphs mphps"
        rare "ft/s2" = 0.3048, 1.0; "fts2 fps2 feetpersecondsquared"
    }
    Force {
        usual "N" = 1.0, 1.0; "newton newtons н"
        usual "kN" = 1e3, 1.0; "kilonewton kilonewtons кн"
        usual "MN" = 1e6, 1.0; "meganewton meganewtons"
        usual "lbf" = POUND_FORCE_N, 1.0; "lb lbs poundforce poundsforce poundforces"
        rare "klbf" = 1e3 * POUND_FORCE_N, 1.0; "kip kips klb klbs kilopounds kilopound kilopoundsforce kilopoundforce"
        rare "kp" = STANDARD_GRAVITY_MPS2, 1.0; "kgf kilopond kiloponds kilogramforce kilogramsforce кгс"
        rare "tf" = 1e3 * STANDARD_GRAVITY_MPS2, 1.0; "mp megapond tonneforce tonnesforce metrictonforce metrictonsforce metrictonf тс"
        rare "short tonf" = 2e3 * POUND_FORCE_N, 1.0; "ustonf ustonsforce shorttonsforce"
        rare "long tonf" = 2240.0 * POUND_FORCE_N, 1.0; "uktonf uktonsforce longtonsforce"
        rare "daN" = 10.0, 1.0; "decanewton decanewtons dekanewton"
    }
    Pressure {
        usual "Pa" = 1.0, 1.0; "pascal pascals"
        usual "kPa" = 1e3, 1.0; "kilopascal kilopascals"
        usual "bar" = 1e5, 1.0; "bars barg"
        rare "hPa" = 100.0, 1.0; "hectopascal hectopascals hektopascal"
        rare "mbar" = 100.0, 1.0; "millibar millibars"
        rare "MPa" = 1e6, 1.0; "megapascal megapascals nmm2"
        rare "psi" = 6894.757293168, 1.0; "psig lbfin2"
        rare "atm" = 101_325.0, 1.0; "atmosphere atmospheres"
        rare "kgf/cm2" = 98_066.5, 1.0; "kpcm2 kgcm2 кгссм2"
    }
    Mass {
        usual "kg" = 1.0, 1.0; "kilogram kilograms kilogramme kilogrammes kgs"
        usual "t" = 1e3, 1.0; "to ton tons tonne tonnes tonnen megagram т"
        rare "lb" = 0.45359237, 1.0; "lbs lbm pound pounds"
        rare "short ton" = 907.18474, 1.0; "shorttons ustons uston"
        rare "long ton" = 1016.0469088, 1.0; "longtons uktons"
    }
    Temperature {
        usual "degC" = 1.0, 1.0; "c celsius gradc grad cel degreecelsius degreescelsius gradcelsius"
        usual "K" shift -273.15 = 1.0, 1.0; "kelvin degk"
        usual "degF" shift -32.0 = 5.0, 9.0; "f fahrenheit degreesfahrenheit"
    }
    Ratio {
        usual "permille" = 1.0, 1e3; "promille permil permill pourmille permille pormil promil mmm mperkm mkm nkn npkn metersperkilometer metresperkilometre"
        usual "%" = 1.0, 1e2; "pct percent prozent pourcent percento porciento procent perc pc m100m ft100ft"
        usual "1" = 1.0, 1.0; "pu ratio mm fraction share anteil"
        // A slope's angle, as small as those of railways: its tangent is the angle to 0.2 %.
        usual "deg" = std::f64::consts::PI, 180.0; "degree degrees grad degrad winkelgrad"
        rare "ft/mi" = 0.3048, 1609.344; "feetpermile ftpermile ftpermi fpmi"
        rare "gon" = std::f64::consts::PI, 200.0; "gradian gradians neugrad"
        rare "rad" = 1.0, 1.0; "radian radians"
        rare "mrad" = 1.0, 1e3; "milliradian milliradians"
    }
    Angle {
        usual "deg" = 1.0, 1.0; "degree degrees grad"
        usual "rad" = 180.0, std::f64::consts::PI; "radian radians"
    }
    Curvature {
        usual "1/m" = 1.0, 1.0; "perm m1 permeter permetre"
        rare "1/km" = 1.0, 1e3; "perkm km1"
    }
    Power {
        usual "W" = 1.0, 1.0; "watt watts"
        usual "kW" = 1e3, 1.0; "kilowatt kilowatts"
        rare "MW" = 1e6, 1.0; "megawatt megawatts"
        rare "hp" = HORSEPOWER_W, 1.0; "bhp horsepower mechanicalhorsepower"
        rare "PS" = 75.0 * STANDARD_GRAVITY_MPS2, 1.0; "cv metrichorsepower pferdestaerke pferdestaerken лс"
    }
    Voltage {
        usual "V" = 1.0, 1.0; "volt volts"
        usual "kV" = 1e3, 1.0; "kilovolt kilovolts"
    }
    Current {
        usual "A" = 1.0, 1.0; "amp amps ampere amperes"
        usual "kA" = 1e3, 1.0; "kiloamp kiloamps kiloampere kiloamperes"
    }
    Count {
        usual "1" = 1.0, 1.0; "bool boolean flag count pax persons"
    }
}

/// Units of things that a dataset has no quantity for.
const FOREIGN: &str = "ma mv hz khz rpm umin 1min nm knm kwh wh mwh j kj mj l lmin db ppm kva ohm gwh kvar var \
                       pas m3 m2 m3s kgs kgh lph gpm nms radps degs rads dbm pct100 cd lx mol wm2 wb";

/// Small letters and digits only.
fn fold(text: &str) -> String {
    let digits = |letter: char| match letter {
        'ä' | 'á' | 'à' => 'a',
        'é' | 'è' => 'e',
        'ó' | 'ò' => 'o',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        'µ' | 'μ' => 'u',
        letter => letter,
    };
    let letters = text.chars().map(digits).flat_map(char::to_lowercase);
    letters.filter(|letter| letter.is_alphanumeric()).collect()
}

/// Returns true for the spelling of any unit, of a dataset's or of another thing's.
pub fn is_unit(text: &str) -> bool {
    FOREIGN.split(' ').any(|unit| unit == fold(text))
        || Unit::all().any(|unit| Unit::spelled(unit.dimension, text).is_some())
}

impl Unit {
    /// Returns the unit of a dimension with this name.
    pub fn find(dimension: Dimension, name: &str) -> Option<Unit> {
        Self::of(dimension).find(|unit| unit.name == name)
    }

    /// Returns the unit of a dimension that is spelled so. The names come first, then case distinguishes nothing (but
    /// mN is no MN).
    pub fn spelled(dimension: Dimension, text: &str) -> Option<Unit> {
        let text = text.trim();
        match (dimension, text) {
            (Dimension::Ratio, "‰" | "0/00" | "o/oo" | "°/oo") => {
                return Self::find(dimension, "permille");
            }
            (Dimension::Ratio | Dimension::Count, "-" | "") => return Self::find(dimension, "1"),
            (Dimension::Ratio | Dimension::Angle, "°") => return Self::find(dimension, "deg"),
            // Nobody's train pulls with thousandths of a newton or a watt.
            (Dimension::Force, "mN") | (Dimension::Power, "mW") => return None,
            _ => {}
        }
        if let Some(exact) = Self::find(dimension, text) {
            return Some(exact);
        }
        // kN are no knots: capitals distinguish units of different things.
        let has_capital = text.chars().any(char::is_uppercase);
        let folded = fold(text);
        if folded.is_empty() || (has_capital && Self::all().any(|unit| unit.name == text)) {
            return None;
        }
        let like = Self::of(dimension).find(|unit| fold(unit.name) == folded);
        let by_list = |unit: &Unit| unit.spellings.split(' ').any(|spelling| spelling == folded);
        like.or_else(|| Self::of(dimension).find(by_list))
    }

    /// Returns every unit.
    pub fn all() -> impl Iterator<Item = Unit> {
        UNITS.iter().copied()
    }

    /// Returns the units of a dimension.
    pub fn of(dimension: Dimension) -> impl Iterator<Item = Unit> {
        Self::all().filter(move |unit| unit.dimension == dimension)
    }

    /// Returns the units of a dimension that recorders use without stating them: the candidates for an unknown factor.
    pub fn usual_of(dimension: Dimension) -> impl Iterator<Item = Unit> {
        Self::of(dimension).filter(|unit| unit.is_usual)
    }

    /// Returns the base unit of a dimension: the one without shift and scale.
    pub fn base_of(dimension: Dimension) -> Unit {
        Self::of(dimension)
            .find(|unit| {
                unit.is_usual && unit.shift == 0.0 && unit.multiply == 1.0 && unit.divide == 1.0
            })
            .expect("every dimension has its base unit")
    }

    /// One of this unit in units of another of the same dimension, shifts left out.
    pub fn in_terms_of(&self, other: &Unit) -> f64 {
        self.multiply / self.divide * other.divide / other.multiply
    }

    /// Returns the name, as written in a dataset.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the dimension of the unit.
    pub fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// Returns a value in this unit, in the dimension's base unit.
    pub fn to_base(&self, value: f64) -> f64 {
        (value + self.shift) * self.multiply / self.divide
    }

    /// Returns a value in the dimension's base unit, in this unit.
    pub fn from_base(&self, base: f64) -> f64 {
        base * self.divide / self.multiply - self.shift
    }

    /// Returns a value in this unit, in another unit of the same dimension; exact for the same unit.
    pub fn convert(&self, value: f64, to: &Unit) -> f64 {
        if self.name == to.name { value } else { to.from_base(self.to_base(value)) }
    }
}

#[cfg(test)]
mod tests;
