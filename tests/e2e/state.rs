//! Estimates that outlive the daemon: they are taken up or refused with a reason, and never torn.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use dynocar::dataset;
use dynocar::replay::{Rate, Replayer};
use dynocar::state::{entry::StateContent, file};
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::identify::published_samples;
use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_core::pipeline::{KeptEstimate, Pipeline};
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, Status, TrainId, TrainSample,
};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::soak::state_kills::kill_writers;
use dynocar_tests::tram;
use dynocar_transport::monotonic_now_ns;
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const TRAIN: TrainId = TrainId(1);

fn demo_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo")
}

pub(super) struct Cast {
    pub(super) site: DaemonSite,
    dataset: Dataset,
}

impl Cast {
    pub(super) fn new() -> Self {
        let site = DaemonSite::new();
        for file in ["train.toml", "track.toml"] {
            let text = std::fs::read_to_string(demo_folder().join(file)).expect("a demo file");
            site.write(file, &text);
        }
        std::fs::create_dir(site.path().join("state")).expect("a state directory");
        Cast { site, dataset: dataset::load(&demo_folder()).expect("the demo's runs") }
    }

    pub(super) fn daemon(&self, lines: [&str; 2], variables: &[(&str, &str)]) -> Process {
        let [train_lines, settings] = lines;
        let text = format!(
            "[state]\ndirectory = \"state\"\ninterval_s = 1\n\
             [[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n{train_lines}\n\
             [[threads]]\nname = \"all\"\n\
             [[pipelines]]\nkind = \"v_mils\"\nthread = \"all\"\nsettings = {{ {settings} }}\n\
             [[pipelines]]\nkind = \"mass_kalman\"\nthread = \"all\"\n"
        );
        let config = self.site.write("daemon.toml", &text);
        self.start(&config, variables)
    }

    fn start(&self, config: &Path, variables: &[(&str, &str)]) -> Process {
        let run = ["run", "--config", config.to_str().unwrap()];
        let daemon = self.site.start_with(DYNOCAR, &run, variables);
        daemon.await_error("serving");
        daemon
    }

    pub(super) fn replay(&self) {
        let mut replayer = Replayer::open(&self.site.host(), TRAIN, Rate::Max).unwrap();
        assert!(replayer.await_daemon(Duration::from_secs(10)));
        self.dataset.runs.iter().for_each(|run| replayer.play(&run.samples, |_| {}));
        replayer.finish();
    }

    pub(super) fn state_file(&self) -> PathBuf {
        self.site.path().join("state/train-1.state")
    }

    pub(super) fn content(&self) -> StateContent {
        let path = self.state_file();
        let text = file::read(&path).unwrap().expect("a state");
        StateContent::from_text(&path, &text).unwrap()
    }

    /// The first snapshot of a daemon that has had no sample.
    fn first_snapshot(&self, kind: PipelineKind) -> ParameterSnapshot {
        let mut reader = SnapshotReader::open(&self.site.host(), TRAIN).unwrap();
        await_true(
            || {
                reader.poll();
                reader.latest(kind, monotonic_now_ns()).is_some_and(|it| !it.is_stale)
            },
            || "a first snapshot".into(),
        );
        *reader.latest(kind, monotonic_now_ns()).unwrap().snapshot
    }
}

fn stop(mut daemon: Process) -> String {
    daemon.signal(Signal::TERM);
    assert!(daemon.wait().success(), "{}", daemon.errors());
    daemon.errors()
}

#[test]
fn a_state_is_taken_up_by_the_next_daemon_and_refused_when_foreign_corrupt_or_old() {
    let cast = Cast::new();
    let daemon = cast.daemon([""; 2], &[]);
    cast.replay();
    await_true(|| cast.state_file().exists(), || "the state".into());
    stop(daemon);
    let content = cast.content();
    let kept = content.estimates.iter().find(|it| it.pipeline == "v_mils").expect("v_mils");

    // Taken up: the stored values, wider, and no more trusted than before any sample.
    let daemon = cast.daemon([""; 2], &[]);
    let first = cast.first_snapshot(PipelineKind::VMils);
    assert_eq!(first.status(), Status::Unestimated);
    for (parameter, &value) in kept.estimate.parameters().iter().zip(kept.estimate.values()) {
        let found = first.value(*parameter).expect("the parameter");
        assert!((found - value).abs() <= 1e-12 * value.abs(), "{parameter}: {found}, kept {value}");
    }
    let kept_std = kept.estimate.covariance()[0].sqrt();
    assert!(first.std(Parameter::DavisA).unwrap() >= kept_std * (1.0 - 1e-9));
    assert!(stop(daemon).contains("warm start"));
    assert_eq!(cast.content(), content, "an estimate without news keeps its age");

    let whole = std::fs::read(cast.state_file()).unwrap();
    let of_another_start = |later_s| {
        let mut content = content.clone();
        for it in &mut content.estimates {
            it.estimated = it.estimated.clone().after_s(later_s);
            it.estimated.since_boot.as_mut().unwrap().boot_id = "another".into();
        }
        file::bytes_of(&content.to_text().unwrap())
    };
    let mut corrupt = whole.clone();
    let digit = corrupt.len() - 2;
    corrupt[digit] = if corrupt[digit] == b'9' { b'8' } else { b'9' };
    let cases = [
        ("wheel_set = \"new\"", "", whole.clone(), "its wheel set is \"\", expected \"new\""),
        ("", "lambda = 0.5", whole.clone(), "its kind or settings were others"),
        ("", "", whole[..whole.len() - 9].to_vec(), "torn: expected"),
        ("", "", corrupt, "corrupt: checksum"),
        ("", "", of_another_start(-720.0 * 3600.0), "720.0 h old, expected at most 168 h"),
        ("", "", of_another_start(7200.0), "2.0 h in the future by this clock"),
        ("", "", b"nonsense".to_vec(), "not a state file"),
    ];
    for (train_lines, settings, bytes, expected) in cases {
        std::fs::write(cast.state_file(), bytes).unwrap();
        let daemon = cast.daemon([train_lines, settings], &[]);
        let first = cast.first_snapshot(PipelineKind::VMils);
        let log = stop(daemon);
        assert!(log.contains(expected) && log.contains("cold start"), "{expected} in\n{log}");
        assert_eq!(first.value(Parameter::DavisA), Some(1.498), "the declared value: {expected}");
    }
}

#[test]
fn a_state_that_cannot_be_written_or_read_does_not_stop_the_daemon() {
    let cast = Cast::new();
    std::fs::create_dir(cast.state_file()).unwrap();
    let daemon = cast.daemon([""; 2], &[]);
    cast.replay();
    daemon.await_error("state not kept, tried again later");
    let log = stop(daemon);
    assert!(log.contains("cold start"), "{log}");
}

fn pipeline(dataset: &Dataset, kind: PipelineKind) -> Pipeline {
    let settings = EstimatorSettings::default_of(kind).expect("a kind that can be built");
    let estimator = settings.build(&dataset.train).expect("default settings");
    Pipeline::new(TRAIN, 0, Arc::clone(&dataset.train), dataset.track.clone(), estimator)
}

/// Samples until the first estimate, and the snapshot at the end.
fn feed(pipeline: &mut Pipeline, samples: &[TrainSample]) -> (usize, ParameterSnapshot) {
    let mut first = usize::MAX;
    for (index, sample) in samples.iter().enumerate() {
        if pipeline.process(sample).status() == Status::Estimated {
            first = first.min(index);
        }
    }
    (first, *pipeline.snapshot())
}

#[test]
fn a_warm_start_is_sooner_estimated_and_no_less_right_than_a_cold_one() {
    let dataset = dataset::load(&demo_folder()).unwrap();
    let samples = published_samples(&dataset, TRAIN);
    let kinds = [
        PipelineKind::Ls,
        PipelineKind::Rls,
        PipelineKind::RegularisedRls,
        PipelineKind::Mils,
        PipelineKind::VMils,
        PipelineKind::ResistanceKalman,
        PipelineKind::TrajectoryKalman,
        PipelineKind::MassKalman,
        PipelineKind::TrainKalman,
    ];
    for kind in kinds {
        let (cold_first, cold) = feed(&mut pipeline(&dataset, kind), &samples);
        let kept =
            KeptEstimate::from_snapshot(&cold).unwrap_or_else(|error| panic!("{kind}: {error}"));
        let kept = kept.after(3600.0);
        let mut warm = pipeline(&dataset, kind);
        assert!(warm.warm_start(&kept), "{kind}");
        assert_eq!(warm.snapshot().status(), Status::Unestimated, "{kind}: no sample yet");
        assert!((warm.snapshot().values[0] / kept.values()[0] - 1.0).abs() < 1e-12, "{kind}");
        let (warm_first, warm) = feed(&mut warm, &samples);
        assert!(warm_first <= cold_first, "{kind}: {warm_first} samples, cold {cold_first}");
        for i in 0..cold.parameter_count as usize {
            let distance = (warm.values[i] - cold.values[i]).abs();
            let std = cold.covariance_at(i, i).sqrt();
            assert!(distance <= 2.0 * std, "{kind}, value {i}: {distance} apart, std {std}");
        }
    }
}

#[test]
fn kinds_without_a_use_for_a_kept_estimate_say_so() {
    let dataset = dataset::load(&demo_folder()).unwrap();
    let kept = KeptEstimate::new(&[Parameter::Adhesion], &[0.1], &[1e-4]).unwrap();
    for &kind in PipelineKind::ALL {
        if EstimatorSettings::default_of(kind).is_some_and(|it| it.build(&dataset.train).is_ok()) {
            assert!(!pipeline(&dataset, kind).warm_start(&kept), "{kind}");
        }
    }
}

#[test]
fn a_writer_killed_at_any_moment_leaves_a_whole_state() {
    let states = kill_writers(Path::new(PEER), 30, 1);
    println!("30 kills among {states} writes");
}

/// The shipped configuration, with these lines before it.
fn shipped(cast: &Cast, lines: &str) -> PathBuf {
    let demo = cast.site.path().join("demo");
    std::fs::create_dir_all(&demo).unwrap();
    for file in ["train.toml", "track.toml"] {
        std::fs::copy(demo_folder().join(file), demo.join(file)).unwrap();
    }
    let text = std::fs::read_to_string(demo_folder().join("../daemon.toml")).unwrap();
    cast.site.write("shipped.toml", &(lines.to_owned() + &text))
}

#[test]
fn killed_after_learning_the_next_daemon_of_the_shipped_configuration_starts_warm() {
    use std::os::unix::fs::PermissionsExt;
    let cast = Cast::new();
    let states = cast.site.path().join("home/states");
    let states_text = states.to_str().unwrap();
    // Only sooner than by default, so that the test need not wait for half a minute.
    let daemon =
        cast.start(&shipped(&cast, "state.interval_s = 1\n"), &[("XDG_STATE_HOME", states_text)]);
    cast.replay();
    let file = states.join("dynocar/train-1.state");
    let kept = || std::fs::read_to_string(&file).unwrap_or_default();
    let is_kept = || ["\"train_kalman\"", "mass_t"].iter().all(|it| kept().contains(it));
    await_true(is_kept, || format!("the estimate in the state: {}", kept()));
    daemon.kill();
    let mode = std::fs::metadata(states.join("dynocar")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o700);

    let daemon = cast.start(&shipped(&cast, ""), &[("XDG_STATE_HOME", states_text)]);
    let first = cast.first_snapshot(PipelineKind::TrainKalman);
    let log = stop(daemon);
    let is_warm = |line: &str| line.contains("warm start") && line.contains("train_kalman");
    assert!(log.lines().any(is_warm), "{log}");
    assert!(first.std(Parameter::Mass).is_some_and(f64::is_finite), "a mass that is known");
}

#[test]
fn a_state_directory_that_cannot_be_used_is_a_warning_and_one_that_is_not_wanted_is_not_made() {
    let cast = Cast::new();
    let log = stop(cast.start(&shipped(&cast, ""), &[("XDG_STATE_HOME", "/proc/nowhere")]));
    assert!(
        log.contains("no state is kept, a restart learns anew: /proc/nowhere/dynocar"),
        "{log}"
    );
    let states = cast.site.path().join("unwanted");
    let config = shipped(&cast, "state.keep = false\n");
    let log = stop(cast.start(&config, &[("XDG_STATE_HOME", states.to_str().unwrap())]));
    assert!(!states.exists() && !log.contains("no state is kept"), "{log}");
    let open = cast.site.path().join("open/dynocar");
    std::fs::create_dir_all(&open).unwrap();
    std::fs::set_permissions(&open, std::os::unix::fs::PermissionsExt::from_mode(0o777)).unwrap();
    let open = open.parent().unwrap().to_str().unwrap();
    let log = stop(cast.start(&shipped(&cast, ""), &[("XDG_STATE_HOME", open)]));
    assert!(log.contains("chmod 700 it"), "{log}");
}

/// The tram as a pipeline serves it.
fn tram_pipeline() -> Pipeline {
    let train = Arc::new(tram::declared());
    let settings = EstimatorSettings::default_of(PipelineKind::TrainKalman).unwrap();
    let estimator = settings.build(&train).unwrap();
    Pipeline::new(TRAIN, 0, train, None, estimator)
}

const IN_USE: [Quantity; 2] = [Quantity::Resistance, Quantity::Mass];

#[test]
fn a_tram_goes_on_with_what_was_in_use_from_the_first_sample_after_a_restart_at_any_moment() {
    let samples = tram::samples(1, 900);
    let mut first = tram_pipeline();
    let (mut restarts, mut cycles, mut held) = (0, [0; 2], [0; 2]);
    let mut kept: Option<KeptEstimate> = None;
    let rate = tram::RATE_HZ as usize;
    for (index, sample) in samples.iter().enumerate() {
        let before = *first.process(sample);
        if index % rate == 0
            && let Ok(now) = KeptEstimate::from_snapshot(&before)
            && !kept.as_ref().is_some_and(|it| it.has_values_of(&now))
        {
            kept = Some(now);
        }
        let Some(kept) = kept.as_ref().filter(|_| index > 4000 && index % 137 == 0) else {
            continue;
        };
        restarts += 1;
        let next = index + 2 * rate;
        let age_ns = sample.time_ns - kept.use_before.sample_time_ns;
        let mut warm = tram_pipeline();
        warm.warm_start(&kept.after(2.0 + 1e-9 * age_ns as f64));
        let after: Vec<ParameterSnapshot> =
            samples[next..].iter().take(20 * rate).map(|it| *warm.process(it)).collect();
        for (place, quantity) in IN_USE.into_iter().enumerate() {
            if before.is_usable_for(quantity) {
                let since = after.iter().position(|it| it.is_usable_for(quantity));
                cycles[place] = cycles[place].max(since.map_or(usize::MAX, |cycles| cycles + 1));
                held[place] += after.iter().filter(|it| it.is_usable_for(quantity)).count();
            }
        }
        let (mass_t, std_t) = (after[0].values[3], after[0].std(Parameter::Mass).unwrap());
        assert!((mass_t - tram::LOADED_T).abs() < 4.0 * std_t, "{mass_t} ± {std_t} t");
    }
    assert!(restarts > 90, "{restarts}");
    assert_eq!(cycles, [1, 1], "cycles until resistance and mass are usable");
    let all = restarts * 20 * rate;
    println!("{restarts} restarts; of 20 s after each usable: {held:?} of {all} cycles");
}

#[test]
fn a_killed_daemon_s_successor_answers_a_driving_controller_with_its_first_samples() {
    let cast = Cast::new();
    cast.site.write("train.toml", tram::FILE);
    let text = "[state]\ndirectory = \"state\"\ninterval_s = 3600\n[[trains]]\nid = 1\nfile = \"train.toml\"\n\
                [[threads]]\nname = \"all\"\n[[pipelines]]\nkind = \"train_kalman\"\nthread = \"all\"\n";
    let config = cast.site.write("daemon.toml", text);
    let start = || cast.start(&config, &[]);
    let mut daemon = start();
    let mut publisher = SamplePublisher::open(&cast.site.host(), TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&cast.site.host(), TRAIN).unwrap();
    let newest = |reader: &mut SnapshotReader| {
        reader.poll();
        let reading = reader.latest(PipelineKind::TrainKalman, monotonic_now_ns());
        reading.map(|it| *it.snapshot)
    };
    // While the train drives, 4 s after it left its seventh stop.
    let samples = tram::samples(1, 600);
    let stands = |index: usize| samples[index].speed_mps == 0.0;
    let departures = (1..samples.len()).filter(|&it| stands(it - 1) && !stands(it));
    let killed = departures.into_iter().nth(7).unwrap() + 80;
    let mut drive = |reader: &mut SnapshotReader, samples: &[TrainSample]| {
        let mut answers = Vec::new();
        for sample in samples {
            let mut sample = *sample;
            publisher.publish(&mut sample).expect("a sample to be taken");
            let is_answered = |it: &ParameterSnapshot| it.sample_sequence >= sample.sequence;
            await_true(
                || newest(reader).is_some_and(|it| is_answered(&it)),
                || "the answer to a sample".into(),
            );
            answers.extend(newest(reader));
        }
        answers
    };
    let before = *drive(&mut reader, &samples[..killed]).last().unwrap();
    assert!(IN_USE.iter().all(|&it| before.is_usable_for(it)), "{:?}", before.reason());
    // The keeper writes the newest state each second.
    let left = cast.site.host().root().join("train-1.state");
    let is_newest = || {
        let text = file::read(&left).ok().flatten()?;
        let content = StateContent::from_text(&left, &text).ok()?;
        Some(content.estimates.first()?.estimate.use_before.sample_time_ns == before.sample_time_ns)
    };
    await_true(|| is_newest() == Some(true), || "what a dying daemon leaves".into());
    daemon.kill();
    assert!(!cast.state_file().exists(), "the hour of the disk has not passed");
    daemon = start();
    let after = drive(&mut reader, &samples[killed + 40..killed + 60]);
    let usable_after = |quantity| after.iter().position(|it| it.is_usable_for(quantity));
    assert_eq!(IN_USE.map(usable_after), [Some(0), Some(0)], "{:?}", after[0].reason());
    assert!((after[0].values[3] / before.values[3] - 1.0).abs() < 0.01);
    stop(daemon);
    assert!(!left.exists() && cast.state_file().exists(), "an orderly end leaves the disk's alone");
}
