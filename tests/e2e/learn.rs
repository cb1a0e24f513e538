//! `dynocar learn` and `dynocar models` as processes, on simulated runs whose truth is known.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

use dynocar::models::{ModelText, UtcSecond};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Status};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings};
use dynocar_tests::soak::day::strange_host::StrangeHost;
use dynocar_transport::channel::Transport;
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Role, monotonic_now_ns};
use dynocar_workshop::learn::{Bounds, LearnError, Learner};
use rustix::process::Signal;

use crate::learn_workplace::{DYNOCAR, SEED, TRAIN, Workplace, await_long, learned};

#[test]
fn an_undeclared_tunnel_becomes_a_candidate_once_and_is_adopted_and_taken_back_by_name() {
    let work = Workplace::from_kinds(&[EffectKind::TunnelDrag]);
    assert!(work.learn(&[]).contains("too few runs"));
    work.record("first", 0..7);
    let said = work.learn(&[]);
    assert!(said.contains("new candidate"), "{said}");
    let models = work.models();
    let [candidate] = &learned(&models)[..] else { panic!("one candidate: {said}") };
    assert_eq!(candidate.origin.effects[0].kind, "tunnel_drag");
    let error = candidate.origin.error.expect("an error on runs held out");
    assert!(error.after_mps < error.before_mps, "{error:?}");
    assert_eq!(candidate.origin.files.len(), 2 + 7, "train, line and seven runs");
    let (train, track) = models.load(candidate.hash).unwrap();
    assert!(train.tunnel_constant_n_per_kn_m > 0.0 || track.is_some());
    for name in ["answer.json", "report.html"] {
        assert!(candidate.folder.join(name).is_file(), "{name}");
    }

    assert!(work.learn(&[]).contains("nothing new"), "the same runs");
    work.record("second", 7..8);
    let said = work.learn(&[]);
    assert!(said.contains(&format!("model {} says so already", candidate.hash)), "{said}");
    assert_eq!(learned(&models).len(), 1, "reported once");

    let hash = candidate.hash.to_string();
    let (status, shown, _) = work.say(&["show", &hash[..5]]);
    assert!(status == Some(0) && shown.contains("tunnel drag") && shown.contains(" ± "), "{shown}");
    let (_, differing, _) = work.say(&["diff", "declared", &hash]);
    assert!(
        differing.contains("resistance.c") && differing.contains("N/kN per (m/s)²"),
        "{differing}"
    );
    let (status, _, refused) = work.say(&["adopt", "ffff", "--by", "Anna"]);
    assert!(status == Some(2) && refused.contains("no such model"), "{refused}");
    assert_eq!(work.say(&["adopt", &hash]).0, Some(2), "nobody signed");
    let (_, decided, _) = work.say(&["adopt", &hash[..6], "--by", "Anna", "--reason", "summer"]);
    assert!(decided.contains(&format!("model {hash} is in force")), "{decided}");
    assert_eq!(models.in_force().unwrap(), Some(candidate.hash));
    assert!(work.say(&["list"]).1.lines().any(|it| it.contains(&hash) && it.contains("in force")));
    assert!(work.learn(&[]).contains("too few runs"), "none since it came in force");
    let (_, back, _) = work.say(&["rollback", "--by", "Bert"]);
    assert!(back.contains("what the configuration declares is in force"), "{back}");
    let (status, _, refused) = work.say(&["rollback", "--by", "Bert"]);
    assert!(status == Some(2) && refused.contains("nothing to roll back"), "{refused}");
}

#[test]
fn a_dragging_brake_is_an_event_with_its_runs_and_no_model() {
    let work = Workplace::from_kinds(&[EffectKind::DraggingBrake]);
    work.record("runs", 0..8);
    let said = work.learn(&[]);
    assert!(said.contains("new maintenance events: 1"), "{said}");
    let models = work.models();
    assert!(learned(&models).is_empty(), "{said}");
    let events = models.events().unwrap();
    let [(1, event)] = &events[..] else { panic!("one event: {events:?}") };
    assert_eq!(event.kind, "dragging_brake");
    assert!(
        event.sentence.starts_with("a dragging brake in ")
            && event.sentence.contains(" (95 % interval ")
    );
    assert!(
        event.windows.iter().all(|it| it.run.starts_with("runs/") && it.t_end_s > it.t_start_s)
    );
    assert!(event.acted.is_some() && said.contains(&event.sentence), "{said}");
    // Findings from the same runs again are no other event.
    std::fs::remove_file(work.path("models/learn/learn.state")).unwrap();
    work.learn(&[]);
    assert_eq!(models.events().unwrap(), events);
}

#[test]
fn where_nothing_acts_nothing_is_put_into_the_store() {
    let work = Workplace::from_kinds(&[]);
    work.record("runs", 0..8);
    let said = work.learn(&[]);
    let models = work.models();
    assert!(learned(&models).is_empty() && models.events().unwrap().is_empty(), "{said}");
}

#[test]
fn a_learner_killed_at_any_moment_leaves_nothing_half_done_and_the_next_one_goes_on() {
    let work = Workplace::from_kinds(&[EffectKind::TunnelDrag]);
    work.record("runs", 0..8);
    let models = work.models();
    for delay_ms in [0, 100, 400, 1200, 2500, 4000] {
        let learner = work.start(&["--once"]);
        std::thread::sleep(Duration::from_millis(delay_ms));
        learner.kill();
        assert!(learned(&models).iter().all(|it| models.load(it.hash).is_ok()));
    }
    // One that stands just before the end: the candidate is there, the memory not yet.
    let said = work.learn(&[]);
    assert_eq!(learned(&models).len(), 1, "{said}");
    std::fs::write(work.path("models/learn/learn.state"), "dynocar-state 1 99 0\nhalf").unwrap();
    let said = work.learn(&[]);
    assert!(said.contains("every run is looked at anew"), "{said}");
    assert!(said.contains("says so already"), "{said}");
    assert_eq!(learned(&models).len(), 1);
    let of_hash = |path: &Path| !path.to_string_lossy().contains(".part");
    let left_out = models.list().unwrap().left_out;
    assert!(!left_out.iter().any(|(path, _)| of_hash(path)), "{left_out:?}");
}

#[test]
fn a_new_suspicion_starts_a_round_and_a_signal_ends_the_learner() {
    let work = Workplace::from_kinds(&[EffectKind::TunnelDrag]);
    let host = work.site.host();
    let _role = RoleLock::claim(&host, TRAIN, Role::Daemon).unwrap();
    let transport = Transport::open(&host, "played-daemon").unwrap();
    let sender = transport.sender::<ParameterSnapshot>(TRAIN).unwrap();
    let page = work.path("history.html");
    let mut learner = work.start(&["--at", "00:00", "--report", page.to_str().unwrap()]);
    await_long(|| learner.errors().contains("too few runs"), || learner.errors());
    work.record("runs", 0..8);
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.epoch, snapshot.train_id) = (1, TRAIN.0);
    snapshot.pipeline_kind = PipelineKind::ResidualMonitor as u32;
    snapshot.status = Status::Estimated as u32;
    snapshot.suspected_effect = EffectKind::TunnelDrag as u32;
    let models = work.models();
    let mut send = || {
        snapshot.sequence += 1;
        snapshot.published_ns = monotonic_now_ns();
        snapshot.vouched_ns = snapshot.published_ns;
        sender.send(&snapshot).unwrap();
    };
    await_long(
        || {
            send();
            !learned(&models).is_empty()
        },
        || format!("candidate:\n{}", learner.errors()),
    );
    assert!(learner.errors().contains("suspected: tunnel_drag"), "{}", learner.errors());
    assert!(learner.end(Signal::TERM).success(), "{}", learner.errors());
    assert!(std::fs::read_to_string(&page).unwrap().contains("tunnel drag"));
}

#[test]
fn the_time_of_the_day_comes_for_a_learner_whose_clock_is_set_forth_and_back() {
    const DAY_S: u64 = 86_400;
    let work = Workplace::from_kinds(&[]);
    let strange = StrangeHost::new(work.site.path(), work.site.path());
    let now_s = UtcSecond::from_time(SystemTime::now()).unix_s;
    // In 5 to 6 hours.
    let at_s = now_s / 3600 * 3600 + 6 * 3600;
    let at = format!("{:02}:00", at_s / 3600 % 24);
    let page = work.path("history.html");
    let mut arguments = work.arguments();
    arguments.extend(["--at", &at, "--report", page.to_str().unwrap()].map(str::to_owned));
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut learner = work.site.start_with(DYNOCAR, &words, &strange.variables());
    // Every round writes the page.
    let await_round = || {
        await_long(|| page.exists(), || format!("round: {}", learner.errors()));
        await_long(|| std::fs::remove_file(&page).is_ok(), || "page".into());
    };
    await_round();
    // Over that time, then a day back and over the same time of another day.
    strange.set_clock_ahead(at_s as i64 + 100 - now_s as i64);
    await_round();
    let yesterday_s = at_s - DAY_S;
    strange.set_clock_ahead(yesterday_s as i64 - 100 - now_s as i64);
    std::thread::sleep(Duration::from_secs(1));
    assert!(!page.exists(), "no time of the day has come");
    strange.set_clock_ahead(yesterday_s as i64 + 100 - now_s as i64);
    await_round();
    assert!(learner.end(Signal::TERM).success(), "{}", learner.errors());
}

#[test]
fn a_signal_ends_a_learner_in_the_middle_of_an_explanation_and_nothing_is_concluded() {
    let work = Workplace::from_kinds(&[EffectKind::TunnelDrag]);
    work.record("runs", 0..8);
    let mut learner = work.start(&["--once"]);
    // The runs are known: they are being read and explained.
    let state = work.path("models/learn/learn.state");
    await_long(|| state.exists(), || learner.errors());
    let status = learner.end(Signal::TERM);
    let said = learner.output();
    assert!(status.success(), "{}", learner.errors());
    let is_concluded = said.contains("new candidate");
    assert_eq!(!learned(&work.models()).is_empty(), is_concluded, "{said}");
    assert!(is_concluded || said.contains("stopped before the end"), "{said}");
}

#[test]
fn where_some_runs_show_no_effect_all_that_can_be_read_are_explained() {
    let kinds = EffectRequest::Kinds(vec![EffectKind::WheelDiameter]);
    let work = Workplace::new(&SimulatorSettings {
        runs: 48,
        duration_s: 300.0,
        ..SimulatorSettings::new(SEED, kinds)
    });
    work.record("all", 0..48);
    let text = |name| std::fs::read_to_string(work.path(name)).unwrap();
    let declared = ModelText { train: text("train.toml"), track: Some(text("track.toml")) };
    let learn = |bounds: Bounds| {
        let mut learner = Learner::open(work.settings(declared.clone(), bounds)).unwrap();
        learner.round(SystemTime::now(), &|| false).unwrap().trains.remove(0).outcome
    };
    let few = Bounds { runs: 1, ..Bounds::default() };
    std::fs::write(work.path("runs/all/runs/03.csv"), "time_s,speed_mps\n0,nowhere\n").unwrap();
    let outcome = learn(Bounds { samples: 2_000, ..few });
    assert!(learned(&work.models()).is_empty(), "too many samples for the memory: {outcome:?}");
    std::fs::remove_dir_all(work.path("models")).unwrap();
    let outcome = learn(few);
    let [model] = &learned(&work.models())[..] else { panic!("{outcome:?}") };
    assert_eq!(model.origin.effects[0].kind, "wheel_diameter");
    let runs = model.origin.files.iter().filter(|file| file.path.ends_with(".csv"));
    assert_eq!(runs.count(), 47);
    // So few are left that the search uses all.
    for number in 4..=9 {
        std::fs::write(work.path(&format!("runs/all/runs/{number:02}.csv")), "").unwrap();
    }
    std::fs::remove_dir_all(work.path("models")).unwrap();
    let outcome = learn(few);
    let [model] = &learned(&work.models())[..] else { panic!("{outcome:?}") };
    let runs = model.origin.files.iter().filter(|file| file.path.ends_with(".csv"));
    assert_eq!(runs.count(), 41);
}

#[test]
fn a_store_has_one_learner() {
    let work = Workplace::from_kinds(&[]);
    let declared = ModelText { train: "a".into(), track: None };
    let settings = || work.settings(declared.clone(), Bounds::default());
    let learner = Learner::open(settings()).unwrap();
    assert!(matches!(Learner::open(settings()), Err(LearnError::Taken { .. })));
    let output = work.learn_once(&[]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("another learner works on this store"), "{errors}");
    drop(learner);
    work.learn(&[]);
}

#[test]
fn runs_and_names_that_cannot_be_are_refused_or_left_out_in_words() {
    let work = Workplace::from_kinds(&[]);
    let refused = |words: &[&str]| {
        let output = work.learn_once(words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let train = work.path("train.toml").display().to_string();
    assert!(refused(&["--report", &train]).contains("none of this command's results"));
    assert!(refused(&["--at", "25:00"]).contains("expected a time of the day"));
    std::fs::create_dir_all(work.path("runs/bad")).unwrap();
    std::fs::write(work.path("runs/bad/dataset.toml"), "[dataset]\nname = 3\n").unwrap();
    std::fs::write(work.path("runs/half.mcap"), b"\x89MCAP0\r\n and no end").unwrap();
    let said = work.learn(&[]);
    assert!(said.contains("left out: ") && said.contains("bad/dataset.toml"), "{said}");
    assert!(!work.learn(&[]).contains("left out"), "reported once");
    let (status, _, empty) = work.say(&["list", "--train", "7"]);
    assert!(status == Some(2) && empty.contains("choose one by --train"), "{empty}");
    let nowhere = ["learn", "--once", "--config"];
    let learn = |config: PathBuf| {
        let output = Command::new(DYNOCAR)
            .args(nowhere)
            .arg(config)
            .arg("--runs")
            .arg(work.path("runs"))
            .output()
            .expect("the program");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (status, errors) = learn(work.path("daemon.toml"));
    assert!(status == Some(2) && errors.contains("no store of models"), "{errors}");
    let declared = std::fs::read_to_string(work.path("daemon.toml")).unwrap();
    let named =
        work.site.write("named.toml", &format!("[models]\ndirectory = \"models\"\n{declared}"));
    assert_eq!(learn(named).0, Some(0), "the store of the configuration");
    std::fs::remove_dir_all(work.path("runs")).unwrap();
    assert!(refused(&[]).contains("expected the folder of recorded runs"));
}
