//! Models on trial, adopted and taken back while the train runs: no process restarts, no sample is lost.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use dynocar::dataset;
use dynocar::models::records::ModelChoice;
use dynocar::models::{
    ModelHash, ModelText, NewDecision, NewModel, Origin, Store, TrainModels, UtcSecond,
};
use dynocar::replay::{Rate, ReplayReport, Replayer};
use dynocar::shadow::record;
use dynocar_analysis::dataset::Dataset;
use dynocar_client::SnapshotReader;
use dynocar_shared::{ParameterSnapshot, Status, TrainId};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_transport::monotonic_now_ns;
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const TRAIN: TrainId = TrainId(1);
/// The demo's declared coefficient a, and a clearly wrong one.
const RIGHT: &str = "a = 1.498";
const WRONG: &str = "a = 4.5";

fn demo_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo")
}

/// A demo's train with a store of models.
struct Cast {
    site: DaemonSite,
    dataset: Dataset,
    /// The train's file, declared with one a.
    train: String,
    track: String,
}

impl Cast {
    fn new(declared: &str) -> Self {
        let text = |file: &str| std::fs::read_to_string(demo_folder().join(file)).expect("a file");
        let (train, track) = (text("train.toml").replace(RIGHT, declared), text("track.toml"));
        let site = DaemonSite::new();
        site.write("train.toml", &train);
        site.write("track.toml", &track);
        std::fs::create_dir(site.path().join("models")).expect("a store");
        Cast {
            site,
            dataset: dataset::load(&demo_folder()).expect("the demo's runs"),
            train,
            track,
        }
    }

    fn models(&self) -> TrainModels {
        Store::at(&self.site.path().join("models")).train(TRAIN)
    }

    /// A daemon on two threads, with more lines in `[models]`.
    fn daemon(&self, lines: &str) -> Process {
        let text = format!(
            "[daemon]\nidle = \"event\"\n[metrics]\nlisten = \"127.0.0.1:0\"\n\
             [models]\ndirectory = \"models\"\ninterval_s = 1\n{lines}\n\
             [[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
             [[threads]]\nname = \"one\"\n[[threads]]\nname = \"two\"\n\
             [[pipelines]]\nkind = \"trajectory_kalman\"\nthread = \"one\"\n\
             [[pipelines]]\nkind = \"residual_monitor\"\nthread = \"two\"\n\
             [[pipelines]]\nkind = \"mass_kalman\"\nthread = \"two\"\n"
        );
        let config = self.site.write("daemon.toml", &text);
        let daemon = self.site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
        daemon.await_error("serving");
        daemon
    }

    /// Puts a model into the store that grew from the declaration, with another a.
    fn put(&self, declared: &str, a: &str) -> ModelHash {
        let text = |train: String| ModelText { train, track: Some(self.track.clone()) };
        let parent = Some(text(self.train.clone()).hash());
        let origin = Origin::written("Another a.", parent, UtcSecond::from_time(SystemTime::now()));
        let text = text(self.train.replace(declared, a));
        let new = NewModel { text, origin, answer_json: None, report_html: None };
        self.models().put(&new).expect("a model is put")
    }

    fn decide(&self, what: ModelChoice) {
        let at = UtcSecond::from_time(SystemTime::now());
        let new = NewDecision { what, by: "test".into(), reason: String::new(), at };
        self.models().decide(&new).expect("a decision");
    }

    /// Drives the demo's runs once.
    fn drive(&self) -> ReplayReport {
        let mut replayer = Replayer::open(&self.site.host(), TRAIN, Rate::Times(1000.0)).unwrap();
        assert!(replayer.await_daemon(Duration::from_secs(10)));
        self.dataset.runs.iter().for_each(|run| replayer.play(&run.samples, |_| {}));
        replayer.finish()
    }

    /// The newest snapshot of each pipeline, once all of them use a model.
    fn snapshots_of(&self, model: ModelHash) -> Vec<ParameterSnapshot> {
        let mut reader = SnapshotReader::open(&self.site.host(), TRAIN).unwrap();
        let mut found = Vec::new();
        await_true(
            || {
                reader.poll();
                let readings = reader.readings(monotonic_now_ns());
                found = readings.map(|reading| *reading.snapshot).collect();
                found.len() == 3 && found.iter().all(|it| it.model_hash == model.0)
            },
            || format!("all pipelines with model {model}"),
        );
        found
    }
}

fn stop(mut daemon: Process) -> String {
    daemon.signal(Signal::TERM);
    assert!(daemon.wait().success(), "{}", daemon.errors());
    daemon.errors()
}

fn accounted(snapshots: &[ParameterSnapshot]) -> Vec<(u64, u64)> {
    let offered = |it: &ParameterSnapshot| it.samples_used + it.samples_rejected + it.samples_lost;
    snapshots.iter().map(|it| (offered(it), it.samples_lost)).collect()
}

#[test]
fn an_adopted_model_goes_to_work_at_standstill_without_a_lost_sample_and_so_does_its_rollback() {
    let cast = Cast::new(WRONG);
    let daemon = cast.daemon("");
    let declared = ModelText { train: cast.train.clone(), track: Some(cast.track.clone()) }.hash();
    let before = cast.snapshots_of(declared);
    let better = cast.put(WRONG, RIGHT);
    daemon.await_error("on trial");
    let driven = cast.drive();
    assert!(driven.snapshots.iter().all(|it| it.model_hash == declared.0));
    cast.decide(ModelChoice::Adopt(better));
    let changed = cast.snapshots_of(better);
    // On a busy machine samples may be lost while it drives; the change loses none.
    let (offered, before_change) = (driven.published, accounted(&driven.snapshots));
    assert_eq!(accounted(&changed), before_change, "the counts go on");
    assert!(before_change.iter().all(|it| it.0 == offered), "{before_change:?}");
    for ((before, driven), after) in before.iter().zip(&driven.snapshots).zip(&changed) {
        assert!(before.generation <= driven.generation && driven.generation < after.generation);
        assert!(driven.sequence < after.sequence && driven.epoch == after.epoch);
        let answers = (driven.quantities, driven.pipeline_index, driven.pipeline_kind);
        assert_eq!(answers, (after.quantities, after.pipeline_index, after.pipeline_kind));
    }
    assert_eq!(changed[0].status(), Status::Estimated, "warm from the shadow: {:?}", changed[0]);

    // It goes on working with it, and takes up where it stood when that is taken back.
    let driven = cast.drive();
    let before_rollback = accounted(&driven.snapshots);
    assert!(before_rollback.iter().all(|it| it.0 == 2 * offered), "{before_rollback:?}");
    cast.decide(ModelChoice::RollBack);
    let back = cast.snapshots_of(declared);
    assert_eq!(accounted(&back), before_rollback);
    let changes = || daemon.errors().matches("in force from now on").count();
    await_true(|| changes() == 2, || "both changes in the log".into());
    stop(daemon);
}

/// Drives until a rule has decided between the declaration and another model.
fn decided_by_rule(declared: &str, rival: &str, adopted_by_hand: bool) {
    let cast = Cast::new(declared);
    let daemon = cast.daemon("adopt = \"when_better\"\ntrips_between_mistakes = 20");
    let rival = cast.put(declared, rival);
    daemon.await_error("on trial");
    if adopted_by_hand {
        cast.decide(ModelChoice::Adopt(rival));
        cast.snapshots_of(rival);
    }
    let wanted = if adopted_by_hand { None } else { Some(rival) };
    let is_done = || cast.models().in_force().unwrap() == wanted;
    for _ in 0..8 {
        if is_done() {
            break;
        }
        cast.drive();
    }
    await_true(is_done, || format!("a decision: {}", daemon.errors()));
    let declared = ModelText { train: cast.train.clone(), track: Some(cast.track.clone()) }.hash();
    cast.snapshots_of(wanted.unwrap_or(declared));
    let decisions = cast.models().decisions().unwrap();
    let (_, last) = decisions.last().unwrap();
    assert_eq!(last.by, "rule");
    assert!(last.reason.contains("open loop over 60 s"), "{}", last.reason);
    let log = stop(daemon);
    assert!(log.contains("decided by rule"), "{log}");
    // The measurements are there for the next daemon.
    let record = record::TrialRecord::read(cast.models().folder());
    let error = |model| record.of(model).and_then(|it| it.error_mps).unwrap();
    let (better, worse) = if adopted_by_hand { (declared, rival) } else { (rival, declared) };
    assert!(error(better) < 0.5 * error(worse), "{} {}", error(better), error(worse));
}

#[test]
fn a_rule_adopts_the_better_model_and_takes_back_the_worse_one() {
    // Side by side: a replay mostly waits.
    std::thread::scope(|scope| {
        scope.spawn(|| decided_by_rule(WRONG, RIGHT, false));
        scope.spawn(|| decided_by_rule(RIGHT, WRONG, true));
    });
}

/// Drives under a rule that does not adopt, until it says so.
fn not_adopted(rule: &str, expected: &str) {
    let cast = Cast::new(WRONG);
    let daemon = cast.daemon(&format!("trips_between_mistakes = 20\n{rule}"));
    let better = cast.put(WRONG, RIGHT);
    daemon.await_error("on trial");
    for _ in 0..8 {
        cast.drive();
        if daemon.errors().contains(expected) {
            break;
        }
    }
    daemon.await_error(expected);
    assert!(daemon.errors().contains(&better.to_string()));
    assert_eq!(cast.models().in_force().unwrap(), None);
    if rule.contains("bounds") {
        // Nor by a person.
        cast.decide(ModelChoice::Adopt(better));
        daemon.await_error("what was decided is not done");
        stop(daemon);
        let daemon = cast.daemon(&format!("trips_between_mistakes = 20\n{rule}"));
        daemon.await_error("the declared model stays in force");
        stop(daemon);
        return;
    }
    stop(daemon);
}

#[test]
fn a_model_out_of_bounds_is_not_adopted_by_the_rule_and_nothing_is_by_asking() {
    let bounded = "adopt = \"when_better\"\nbounds = { \"resistance.a\" = [3, 6] }";
    std::thread::scope(|scope| {
        scope.spawn(|| not_adopted(bounded, "out of bounds"));
        scope.spawn(|| not_adopted("adopt = \"ask\"", "dynocar models adopt"));
    });
}

#[test]
fn a_daemon_killed_at_any_moment_of_a_change_serves_what_was_decided() {
    let cast = Cast::new(WRONG);
    let better = cast.put(WRONG, RIGHT);
    let declared = ModelText { train: cast.train.clone(), track: Some(cast.track.clone()) }.hash();
    for round in 0..6_u32 {
        let daemon = cast.daemon("");
        let (what, expected) = match round % 2 {
            0 => (ModelChoice::Adopt(better), better),
            _ => (ModelChoice::RollBack, declared),
        };
        daemon.await_error("models are tried");
        cast.decide(what);
        // Before the change, in it, or after it.
        std::thread::sleep(Duration::from_millis(u64::from(round) * 250));
        daemon.kill();
        let daemon = cast.daemon("");
        cast.snapshots_of(expected);
        stop(daemon);
    }
}

#[test]
fn a_store_that_cannot_be_read_leaves_the_declared_model_in_force() {
    let cast = Cast::new(RIGHT);
    let declared = ModelText { train: cast.train.clone(), track: Some(cast.track.clone()) }.hash();
    let other = cast.put(RIGHT, WRONG);
    cast.decide(ModelChoice::Adopt(other));
    let file = cast.models().folder().join(other.to_string()).join("train.toml");
    std::fs::write(&file, "[train]\n").unwrap();
    let daemon = cast.daemon("");
    cast.snapshots_of(declared);
    let log = stop(daemon);
    assert!(log.contains("the declared model stays in force"), "{log}");
    assert!(log.contains("changed after it was put into the store"), "{log}");
}
