//! Which estimators now and then compute for long.

use dynocar_shared::PipelineKind;

/// True for an estimator whose step may take longer than a fast pipeline may be held up: one that
/// iterates over a whole window or stretch. It never shares a thread with a fast one.
pub const fn is_slow(kind: PipelineKind) -> bool {
    matches!(
        kind,
        PipelineKind::TrajectoryNewton
            | PipelineKind::AdhesionEm
            | PipelineKind::BrakeEm
            | PipelineKind::StagedDescent
            | PipelineKind::JointLeastSquares
    )
}
