//! Fields of a sample and a snapshot: the only table from which recordings, the page of their fields and every other
//! named representation of them are made.
//!
//! Names, types and meanings are those of the structs; the units are those in the names.

use crate::layout::FieldLayout;
use crate::sample::{SampleField, TrainSample};
use crate::snapshot::ParameterSnapshot;
use crate::vocabulary::Parameter;

/// When a field has no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The field always has a value.
    Never,
    /// Unless the bit of this quantity is set in [`TrainSample::valid`].
    Unless(SampleField),
    /// In every written form: the presence of the other fields shows its value.
    SaidByOthers,
}

/// A field of a sample or a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its index in the struct's layout.
    pub index: usize,
    /// Name, type, offset and size.
    pub layout: &'static FieldLayout,
    /// Meaning of the field.
    pub meaning: &'static str,
    /// When it has no value.
    pub missing: Missing,
}

impl Field {
    /// Returns the unit; empty for a count, a number of a vocabulary or a ratio.
    pub fn unit(&self) -> &'static str {
        unit_of(self.layout.name)
    }

    /// Returns the type of an entry, for an array; else its own.
    pub fn entry_type(&self) -> &'static str {
        let name = self.layout.type_name;
        name.strip_prefix('[').and_then(|it| it.split(';').next()).unwrap_or(name)
    }

    /// Returns true for an array.
    pub fn is_array(&self) -> bool {
        self.layout.type_name.starts_with('[')
    }

    /// Returns the type of an entry in NumPy's notation, as it lies in shared memory: `<f8` on most hosts.
    pub fn numpy_type(&self) -> String {
        let (kind, bits) = self.entry_type().split_at(1);
        let bytes = bits.parse().map_or(0, |bits: usize| bits / 8);
        let order = match (bytes, cfg!(target_endian = "little")) {
            (1, _) => '|',
            (_, true) => '<',
            (_, false) => '>',
        };
        format!("{order}{kind}{bytes}")
    }

    /// Returns how many entries there are; 1 unless it is an array.
    pub fn entries(&self) -> usize {
        let count = self.layout.type_name.split_once("; ").map(|it| it.1.trim_end_matches(']'));
        count.map_or(1, |it| it.parse().unwrap_or(0))
    }
}

/// Returns the fields of [`TrainSample`], in order.
pub fn sample_fields() -> impl Iterator<Item = Field> {
    table(TrainSample::LAYOUT, TrainSample::MEANINGS)
}

/// Returns the fields of [`ParameterSnapshot`], in order.
pub fn snapshot_fields() -> impl Iterator<Item = Field> {
    table(ParameterSnapshot::LAYOUT, ParameterSnapshot::MEANINGS)
}

fn table(
    layout: &'static [FieldLayout],
    meanings: &'static [&'static str],
) -> impl Iterator<Item = Field> {
    layout.iter().zip(meanings).enumerate().map(|(index, (layout, meaning))| {
        let measured = SampleField::ALL.into_iter().find(|it| it.name() == layout.name);
        let missing = match (measured, layout.name) {
            (Some(field), _) => Missing::Unless(field),
            (None, "valid") => Missing::SaidByOthers,
            (None, _) => Missing::Never,
        };
        Field { index, layout, meaning: meaning.trim(), missing }
    })
}

/// How names end, and the unit that it says; a longer end before those it ends with.
const UNITS: [(&str, &str); 15] = [
    ("_n_per_kn_per_mps2", "N/kN per (m/s)²"),
    ("_n_per_kn_per_mps", "N/kN per m/s"),
    ("_n_per_kn", "N/kN"),
    ("_permille", "‰"),
    ("_mps2", "m/s²"),
    ("_degc", "°C"),
    ("_mps", "m/s"),
    ("_ns", "ns"),
    ("_pa", "Pa"),
    ("_kg", "kg"),
    ("_km", "km"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
    ("_t", "t"),
];

/// Returns the end of a name that says its unit, with the unit; both empty where there is none.
pub fn unit_end(name: &str) -> (&'static str, &'static str) {
    UNITS.into_iter().find(|(end, _)| name.ends_with(end)).unwrap_or(("", ""))
}

/// Returns the unit that a name says; empty where it says none.
pub fn unit_of(name: &str) -> &'static str {
    unit_end(name).1
}

impl Parameter {
    /// Returns the parameter's name with its unit, for a place where nothing else says them.
    pub const fn full_name(self) -> &'static str {
        match self {
            Parameter::DavisA => "resistance_a_n_per_kn",
            Parameter::DavisB => "resistance_b_n_per_kn_per_mps",
            Parameter::DavisC => "resistance_c_n_per_kn_per_mps2",
            other => other.name(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_measured_quantity_is_a_field_that_may_be_missing() {
        let may_be_missing: Vec<_> =
            sample_fields().filter(|it| matches!(it.missing, Missing::Unless(_))).collect();
        assert_eq!(may_be_missing.len(), SampleField::ALL.len());
        for (field, quantity) in may_be_missing.iter().zip(SampleField::ALL) {
            assert_eq!(field.missing, Missing::Unless(quantity));
            assert_eq!((field.layout.type_name, field.unit().is_empty()), ("f64", false));
        }
    }

    #[test]
    fn every_field_says_what_it_is_and_names_say_the_unit() {
        for field in sample_fields().chain(snapshot_fields()) {
            let is_said = field.meaning.ends_with(['.', '…']) && field.meaning.len() > 8;
            assert!(is_said, "{}: {:?}", field.layout.name, field.meaning);
        }
        let unit = |name| snapshot_fields().find(|it| it.layout.name == name).map(|it| it.unit());
        assert_eq!(unit("published_ns"), Some("ns"));
        assert_eq!(unit("unexplained_force_std_n"), Some("N"));
        assert_eq!(unit("innovation_correlation"), Some(""));
        assert_eq!(unit_of(Parameter::DavisC.full_name()), "N/kN per (m/s)²");
    }

    #[test]
    fn entries_of_a_numpy_type_fill_the_field_and_the_fields_the_struct() {
        let sizes = [size_of::<TrainSample>(), size_of::<ParameterSnapshot>()];
        let fields: [Vec<Field>; 2] = [sample_fields().collect(), snapshot_fields().collect()];
        for (fields, size) in fields.iter().zip(sizes) {
            let mut end = 0;
            for field in fields {
                assert_eq!(field.layout.offset, end, "{}", field.layout.name);
                let bytes: usize = field.numpy_type()[2..].parse().unwrap();
                assert_eq!(field.entries() * bytes, field.layout.size, "{}", field.layout.name);
                end += field.layout.size;
            }
            assert_eq!(end, size);
        }
    }
}
