//! Why another project's file cannot be imported.

use crate::dataset::{Problem, SourcePosition};

/// Why nothing can be imported, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct ImportError {
    /// File and line.
    pub place: SourcePosition,
    /// What is wrong there.
    pub problem: Box<ImportProblem>,
}

impl ImportError {
    /// A problem at a place.
    pub(super) fn new(place: SourcePosition, problem: impl Into<ImportProblem>) -> Self {
        ImportError { place, problem: Box::new(problem.into()) }
    }
}

/// What stands in the way of an import.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportProblem {
    /// A key or a value that the format does not have.
    #[error("{0}")]
    File(#[from] Problem),
    /// A railML file.
    #[error(
        "railML is not imported: its licence forbids an open implementation without certification; \
         convert the file to railtoolkit's schema, or write train.toml and track.toml by hand"
    )]
    RailMl,
    /// Another XML file.
    #[error("expected YAML or JSON, found XML with the root '{root}'; {EXPECTED}")]
    Xml {
        /// The root element.
        root: String,
    },
    /// A file of no known format.
    #[error("the format is not recognised: {found}; {EXPECTED}; --format says which it is")]
    NotRecognised {
        /// What the file holds.
        found: String,
    },
    /// A version of a schema that is not known.
    #[error("schema_version = {found}: expected {expected}")]
    Version {
        /// The file's.
        found: String,
        /// Those that are known.
        expected: String,
    },
    /// An identifier that is taken.
    #[error("{key} = '{id}': expected another than in line {first_line}, which is the same")]
    Repeated {
        /// The key.
        key: String,
        /// The identifier.
        id: String,
        /// Line, from 1, where it stands first.
        first_line: usize,
    },
    /// A vehicle of a formation that nobody describes.
    #[error("{key}: the vehicle '{id}' is described in none of the files; give its file too")]
    NoVehicle {
        /// The place in the formation.
        key: String,
        /// The vehicle.
        id: String,
    },
    /// Davis coefficients whose unit their size does not reveal.
    #[error(
        "{key}: {by_force:.3e} N/kN at {speed_mps:.1} m/s if A, B and C are in N for the whole \
         train, {by_mass:.3e} N/kN if for each kg, and neither can be: is the mass of {mass_kg} kg \
         right?"
    )]
    Davis {
        /// The key.
        key: String,
        /// Speed in m/s that the readings are compared at.
        speed_mps: f64,
        /// Resistance in N/kN by the first reading.
        by_force: f64,
        /// Resistance in N/kN by the second reading.
        by_mass: f64,
        /// Mass in kg of the train.
        mass_kg: f64,
    },
}

const EXPECTED: &str = "expected a railtoolkit rolling stock or running path (a key 'schema'), a \
                        TTOBench track or train ('metadata' with 'stops' or 'mass'), or an OSRD \
                        rolling stock ('rolling_resistance')";
