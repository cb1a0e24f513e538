//! Properties of samples and snapshots with arbitrary bits.

use std::sync::Arc;

use dynocar_client::SnapshotReader;
use dynocar_core::pipeline::{KeptEstimate, Pipeline};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, SampleField, Status, TrainId, TrainSample,
};
use dynocar_tests::process::DaemonSite;
use dynocar_transport::channel::Transport;
use dynocar_transport::monotonic_now_ns;
use proptest::prelude::*;

const TRAIN: TrainId = TrainId(1);

/// Any bits, with a higher share of the numbers that break readers.
fn any_float() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => any::<u64>().prop_map(f64::from_bits),
        3 => -100.0..100.0,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(0.0),
    ]
}

/// A mostly plausible sample, so that a sequence of them reaches more than the first check.
fn any_sample() -> impl Strategy<Value = TrainSample> {
    let fields = prop::collection::vec((0..SampleField::ALL.len(), any_float()), 0..3);
    (any::<u16>(), -1_i8..=2, 0_u32..3, -50_000_000_i64..400_000_000, fields, 0_u64..4).prop_map(
        |(valid, direction, run, step_ns, wrong, gap)| {
            let mut sample = TrainSample::empty(TRAIN)
                .with(SampleField::Speed, 20.0)
                .with(SampleField::TractionForce, 1e4)
                .with(SampleField::BrakeForce, 0.0)
                .with(SampleField::Gradient, 0.0);
            sample.valid |= valid & 0x7ff & !SampleField::Position.bit();
            (sample.direction, sample.run) = (direction, run);
            // Step and gap, made absolute by the test.
            (sample.time_ns, sample.sequence) = (step_ns, gap);
            wrong.into_iter().for_each(|(field, value)| sample.set(SampleField::ALL[field], value));
            sample
        },
    )
}

fn train() -> Arc<TrainModel> {
    let text = "[train]\nmass_t = 200\nlength_m = 120\nrotating_mass_factor = 0.08\n\
                [resistance]\na = 1.9\nb = 0.03\nc = 0.0043\n\
                [brake]\nmax_force_kn = 150\ncylinder_diameter_mm = 203\ndisc_radius_mm = 297\n\
                wheel_radius_mm = 460\nefficiency = 0.85\nratio = 2.55\nfriction = 0.28\npads = 24\n";
    Arc::new(dynocar_analysis::dataset::parse_train("train.toml", text).expect("a train"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn any_sequence_of_samples_is_accounted_for_and_leaves_finite_snapshots(
        samples in prop::collection::vec(any_sample(), 1..120),
        kind in prop::sample::select(PipelineKind::ALL),
    ) {
        let train = train();
        let settings = EstimatorSettings::default_of(kind).expect("a kind that can be built");
        let estimator = settings.build(&train).expect("a train that declares a brake gear");
        let mut pipeline = Pipeline::new(TRAIN, 0, train, None, estimator);
        let (mut time_ns, mut sequence) = (0, 0);
        for (offered, mut sample) in (1..).zip(samples) {
            time_ns += sample.time_ns;
            sequence += sample.sequence;
            (sample.time_ns, sample.sequence) = (time_ns, sequence);
            let it = pipeline.process(&sample);
            prop_assert_eq!(it.samples_used + it.samples_rejected, offered);
            let by_reason: u64 = it.rejected_by_reason.iter().map(|&it| u64::from(it)).sum();
            prop_assert_eq!(by_reason, it.samples_rejected);
            prop_assert!(it.values.iter().chain(&it.covariance).all(|it| it.is_finite()));
            prop_assert!(Status::from_number(it.status).is_some());
        }
    }

    #[test]
    fn a_kept_estimate_is_sound_whatever_the_snapshot(
        values in prop::array::uniform6(any_float()),
        covariance in prop::collection::vec(any_float(), 21),
        parameters in prop::array::uniform6(0_u32..20),
        count in 0_u32..9,
        statistics in prop::array::uniform2(any_float()),
        elapsed_s in any_float(),
    ) {
        let mut it = ParameterSnapshot::empty();
        it.status = Status::Estimated as u32;
        (it.values, it.parameters, it.parameter_count) = (values, parameters, count);
        it.covariance.copy_from_slice(&covariance);
        [it.innovation_mean_square, it.innovation_correlation] = statistics;
        if let Ok(kept) = KeptEstimate::from_snapshot(&it) {
            prop_assert!(kept.values().iter().all(|it| it.is_finite()));
            if elapsed_s.is_finite() && kept.values().iter().all(|it| it.abs() < 1e100) {
                let aged = kept.after(elapsed_s);
                prop_assert!(aged.covariance()[0] >= kept.covariance()[0]);
            }
        }
    }

    #[test]
    fn resistance_from_any_snapshot_has_no_negative_deviation(
        values in prop::array::uniform3(-1e3..1e3),
        covariance in prop::collection::vec(-1e3..1e3, 6),
        speed_mps in any_float(),
    ) {
        let mut it = ParameterSnapshot::empty();
        it.parameter_count = 3;
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        it.parameters[..3].copy_from_slice(&davis.map(|it| it as u32));
        it.values[..3].copy_from_slice(&values);
        it.covariance[..6].copy_from_slice(&covariance);
        if let Some(estimate) = it.resistance_at(speed_mps) {
            prop_assert!(speed_mps.is_finite());
            prop_assert!(!(estimate.w0_std_n_per_kn < 0.0));
        }
    }

    #[test]
    fn davis_is_what_it_says_at_any_speed(a in 0.0..10.0, b in 0.0..0.1, c in 0.0..0.01, v in 0.0..100.0) {
        let davis = Davis { a, b, c };
        prop_assert!(davis.w0_n_per_kn(v) >= a);
    }
}

/// A snapshot of which one word is any bits.
fn spoiled(word: usize, bits: u64) -> ParameterSnapshot {
    let mut it = ParameterSnapshot::empty();
    let now_ns = monotonic_now_ns();
    (it.train_id, it.sequence, it.epoch) = (TRAIN.0, 1, 1);
    (it.published_ns, it.vouched_ns) = (now_ns, now_ns);
    let float = f64::from_bits(bits);
    match word {
        0 => it.epoch = bits,
        1 => it.sequence = bits,
        2 => it.train_id = bits,
        3 => it.pipeline_index = bits as u32,
        4 => it.status = bits as u32,
        5 => it.vouched_ns = bits as i64,
        6 => it.parameter_count = bits as u32,
        7 => it.parameters[(bits % 6) as usize] = bits as u32,
        8..=13 => it.values[word - 8] = float,
        14..=34 => it.covariance[word - 14] = float,
        35 => it.innovation_mean_square = float,
        36 => it.unexplained_force_n = float,
        37 => it.speed_min_mps = float,
        _ => it.reason = bits as u32,
    }
    it
}

#[test]
fn whatever_a_daemon_sends_a_reader_gives_only_finite_numbers_that_grow_old() {
    use proptest::test_runner::{Config, TestRunner};
    let site = DaemonSite::new();
    let host = site.host();
    let transport = Transport::open(&host, "test-daemon").unwrap();
    let sender = transport.sender::<ParameterSnapshot>(TRAIN).unwrap();
    let config = Config { cases: 2_000, failure_persistence: None, ..Config::default() };
    let reader = std::cell::RefCell::new(SnapshotReader::open(&host, TRAIN).unwrap());
    let offered = std::cell::Cell::new(0_u64);
    let bits = prop_oneof![any::<u64>(), any_float().prop_map(f64::to_bits)];
    let checked = TestRunner::new(config).run(&(0_usize..39, bits), |(word, bits)| {
        let reader = &mut *reader.borrow_mut();
        sender.send(&spoiled(word, bits)).unwrap();
        offered.set(offered.get() + 1);
        reader.poll();
        // Long after, nothing may pass for fresh.
        let later_ns = monotonic_now_ns() + 10_000_000_000;
        for reading in reader.readings(later_ns) {
            let it = reading.snapshot;
            let numbers = it.values.iter().chain(&it.covariance);
            prop_assert!(numbers.chain([&it.speed_min_mps]).all(|it| it.is_finite()));
            prop_assert!(reading.is_stale && !reading.is_usable(), "{:?}", it);
            prop_assert!((it.parameter_count as usize) <= it.values.len());
            prop_assert_eq!(it.train_id, TRAIN.0);
            // Reading a parameter never runs out of the array.
            let _ = (it.resistance_at(20.0), it.value(Parameter::Mass), it.std(Parameter::Mass));
        }
        Ok(())
    });
    checked.unwrap();
    let refused = reader.borrow().refused();
    assert!((1..offered.get()).contains(&refused), "{refused} of {} refused", offered.get());
}
