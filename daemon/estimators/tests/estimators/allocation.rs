//! No pipeline allocates while it takes samples: an allocator that counts proves it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::{Track, TrackCurve, Tunnel};
use dynocar_model::train::{BrakeGear, Davis, EffortCurve, TrainModel};
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};

use crate::braking::simulation;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting the requests of each thread.
struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator; the counter is a plain
// thread-local cell without a destructor and allocates nothing itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: `pointer` came from `alloc` above with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn train() -> Arc<TrainModel> {
    let resistance = Davis { a: 1.8, b: 0.03, c: 0.0035 };
    Arc::new(TrainModel {
        length_m: 100.0,
        cars: 4,
        rotating_mass_factor: 0.06,
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.00013,
        traction: EffortCurve::new(vec![(0.0, 60_000.0), (40.0, 30_000.0)]),
        brake: EffortCurve::new(vec![(0.0, 150_000.0)]),
        brake_gear: BrakeGear {
            cylinder_diameter_mm: Some(254.0),
            disc_radius_mm: Some(240.0),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.9),
            ratio: Some(2.55),
            friction: Some(0.35),
            pads: Some(48.0),
            ..BrakeGear::default()
        },
        ..TrainModel::bare("test", 200_000.0, resistance)
    })
}

fn track() -> Arc<Track> {
    let gradient: Vec<_> =
        (0..40).map(|i| (500.0 * f64::from(i), 6.0 * f64::from(i).sin())).collect();
    let curves = vec![TrackCurve { start_m: 900.0, end_m: 1400.0, radius_m: 500.0 }];
    let tunnels = vec![Tunnel { start_m: 2500.0, end_m: 3300.0 }];
    Arc::new(Track::new("t".into(), None, Some(&gradient), Some(curves), Some(tunnels)).unwrap())
}

/// Stops and starts for half an hour at 5 Hz, with spikes, gaps, missing forces and wheel slide.
fn samples() -> Vec<TrainSample> {
    let (train, track) = (train(), track());
    let weight_kn = TrainModel::weight_kn(train.mass_kg);
    let (mut speed_mps, mut position_m) = (0.0_f64, 500.0);
    (0..9_000_u64)
        .map(|index| {
            let force = match index % 900 {
                0..150 => 30.0,
                150..600 => 0.0,
                _ => -20.0,
            };
            let gradient = track.gradient_permille(position_m, train.length_m).unwrap();
            let retarding = train.resistance.w0_n_per_kn(speed_mps) + gradient;
            speed_mps = (speed_mps + 0.2 * (force - retarding) / 108.0).max(0.0);
            position_m += 0.2 * speed_mps;
            let jitter = 0.03 * (index as f64 * 12.9898).sin();
            let mut sample = TrainSample::empty(TrainId(1))
                .with(SampleField::Speed, (speed_mps + jitter).max(0.0))
                .with(SampleField::Position, position_m)
                .with(SampleField::TractionForce, (force * weight_kn).max(0.0))
                .with(SampleField::BrakeForce, (-force * weight_kn).max(0.0))
                .with(SampleField::BrakeCylinderPressure, if force < 0.0 { 3e5 } else { 0.0 })
                .with(SampleField::AmbientTemperature, 12.0);
            sample.time_ns = index as i64 * 200_000_000;
            sample.sequence = index + 1;
            match index % 500 {
                77 => sample.speed_mps += 0.7,
                133 => sample.speed_mps = f64::NAN,
                210..=214 => sample.valid &= !SampleField::TractionForce.bit(),
                299 => sample.flags = 1,
                400 => sample.time_ns += 90_000_000,
                _ => {}
            }
            sample
        })
        .collect()
}

#[test]
fn no_pipeline_allocates_after_it_is_built() {
    let samples = samples();
    let mut covered = 0;
    for &kind in PipelineKind::ALL {
        let Some(settings) = EstimatorSettings::default_of(kind) else { continue };
        let (train, track) = (train(), track());
        let estimator = settings.build(&train).expect("default settings are in range");
        let mut pipeline = Pipeline::new(TrainId(1), 0, train, Some(track), estimator);
        let before = ALLOCATIONS.with(Cell::get);
        for sample in &samples {
            std::hint::black_box(pipeline.process(sample));
        }
        let allocations = ALLOCATIONS.with(Cell::get) - before;
        assert_eq!(allocations, 0, "{kind}");
        assert!(pipeline.snapshot().samples_used > 0, "{kind}: samples were used");
        covered += 1;
    }
    assert!(covered >= 2, "echo alone proves nothing");
}

/// A steady deceleration, with an outlier, a gap and a pause.
fn braking_sample(index: u64) -> TrainSample {
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
fn a_braking_pipeline_allocates_only_while_it_is_built() {
    for kind in simulation::KINDS {
        let settings = EstimatorSettings::default_of(kind).expect("a braking pipeline");
        let mut pipeline = simulation::pipeline(&settings);
        let before = ALLOCATIONS.with(Cell::get);
        for index in 0..400 {
            pipeline.process(&braking_sample(index));
        }
        let allocated = ALLOCATIONS.with(Cell::get) - before;
        assert!(pipeline.snapshot().updates > 0, "{kind} has worked");
        assert_eq!(allocated, 0, "{kind}");
    }
}

#[test]
fn the_counter_counts() {
    let before = ALLOCATIONS.with(Cell::get);
    drop(std::hint::black_box(vec![1_u8; 100]));
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 2);
}
