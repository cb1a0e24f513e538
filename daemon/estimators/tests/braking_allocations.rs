//! No braking pipeline allocates once it is built.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting the calls of each thread.
struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises about the layout are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn train() -> TrainModel {
    TrainModel {
        name: "CRH3".into(),
        mass_kg: 536_000.0,
        length_m: 200.0,
        cars: 8,
        passenger_mass_kg: 70.0,
        rotating_mass_factor: 0.0,
        resistance: Davis { a: 0.79, b: 0.023, c: 0.0015 },
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: None,
        brake: None,
        drive: None,
        brake_gear: BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            friction_brake: None,
        },
        corrections: Default::default(),
        extra: Vec::new(),
    }
}

/// A steady deceleration, with an outlier, a gap and a pause.
fn sample(index: u64) -> TrainSample {
    let time_s = 0.2 * index as f64 + if index > 200 { 30.0 } else { 0.0 };
    let speed_mps = (90.0 - 0.9 * 0.2 * index as f64).max(0.0);
    let position_m = 90.0 * time_s - 0.45 * time_s * time_s;
    let spike_m = if index == 100 { 20.0 } else { 0.0 };
    let pressure_pa = if (150..160).contains(&index) { 0.0 } else { 410_000.0 };
    let mut sample = TrainSample::empty(TrainId(1))
        .with(SampleField::Position, position_m + spike_m)
        .with(SampleField::Speed, speed_mps)
        .with(SampleField::BrakeCylinderPressure, pressure_pa)
        .with(SampleField::Gradient, 0.0);
    sample.time_ns = (time_s * 1e9) as i64;
    sample.sequence = index + 1;
    sample
}

#[test]
fn a_pipeline_allocates_only_while_it_is_built() {
    for kind in [
        PipelineKind::AdhesionEm,
        PipelineKind::AdhesionEkf,
        PipelineKind::AdhesionSmoother,
        PipelineKind::AdhesionLaw,
        PipelineKind::BrakeEm,
        PipelineKind::BrakeEkf,
        PipelineKind::BrakeSmoother,
    ] {
        let train = Arc::new(train());
        let settings = EstimatorSettings::default_of(kind).expect("a braking pipeline");
        let estimator = settings.build(&train).expect("default settings");
        let mut pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
        let before = ALLOCATIONS.with(Cell::get);
        for index in 0..400 {
            pipeline.process(&sample(index));
        }
        let allocated = ALLOCATIONS.with(Cell::get) - before;
        assert!(pipeline.snapshot().updates > 0, "{kind} has worked");
        assert_eq!(allocated, 0, "{kind}");
    }
}
