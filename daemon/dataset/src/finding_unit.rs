//! The unit that a finding is told in.

use dynocar_core::plausibility::{Finding, Slip};
use dynocar_core::units::Unit;

use super::manifest::Manifest;
use super::quantity::Quantity;

/// The quantities that a slip is about, and the unit to tell it in where none of them is mapped.
pub(super) fn concerned(slip: Slip) -> (&'static [Quantity], &'static str) {
    use Quantity::*;
    match slip {
        Slip::TimeScale => (&[Time], "s"),
        Slip::SpeedScale => (&[Speed], "m/s"),
        Slip::PositionScale | Slip::DirectionReversed => (&[Position], "m"),
        Slip::MassScale => (&[TrainMass], "t"),
        Slip::BrakeScale => (&[BrakeForce, ControlForce], "kN"),
        Slip::ForcesSwapped | Slip::ForcesScale | Slip::TractionScale => {
            (&[TractionForce, BrakeForce, ControlForce], "kN")
        }
        Slip::GradientSign | Slip::GradientScale => (&[Gradient], "permille"),
        Slip::PressureScale => (&[BrakeCylinderPressure], "Pa"),
    }
}

/// The unit in which the manifest reads the quantity of a finding.
pub(super) fn read_as(manifest: &Manifest, finding: Finding) -> &'static str {
    let (quantities, otherwise) = concerned(finding.slip);
    let mapped = quantities.iter().find_map(|&quantity| manifest.mapping(quantity));
    mapped.map_or(otherwise, |mapping| mapping.unit.name())
}

/// The unit of a finding's quantity with this name.
pub(super) fn unit_of(finding: Finding, name: &str) -> Unit {
    let dimension = finding.slip.dimension();
    Unit::find(dimension, name).unwrap_or_else(|| Unit::base_of(dimension))
}
