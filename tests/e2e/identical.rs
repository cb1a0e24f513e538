//! The daemon online and `dynocar identify` offline give the same bits from the same samples.

use std::path::Path;
use std::time::Duration;

use dynocar::config::is_slow;
use dynocar::dataset;
use dynocar::replay::{Rate, ReplayReport, Replayer};
use dynocar_analysis::identify::{default_estimators, identify, published_samples};
use dynocar_shared::{ParameterSnapshot, TrainId};
use dynocar_tests::golden::without_stamps;
use dynocar_tests::process::DaemonSite;
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

/// Returns the bits of the values, so that NaN and the sign of zero count in a comparison.
fn bits(snapshot: &ParameterSnapshot) -> Vec<u64> {
    snapshot.values.iter().chain(&snapshot.covariance).map(|value| value.to_bits()).collect()
}

#[test]
fn every_pipeline_gives_the_same_bits_online_and_offline() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let dataset = dataset::load(&folder).unwrap();
    let train = TrainId(1);
    let samples = published_samples(&dataset, train);
    let estimators = default_estimators();

    let site = DaemonSite::new();
    let pipelines: String = estimators
        .iter()
        .map(|it| {
            let thread = if is_slow(it.kind()) { "slow" } else { "fast" };
            format!("[[pipelines]]\nkind = \"{}\"\nthread = \"{thread}\"\n", it.kind())
        })
        .collect();
    for file in ["train.toml", "track.toml"] {
        site.write(file, &std::fs::read_to_string(folder.join(file)).unwrap());
    }
    let config = site.write(
        "daemon.toml",
        &format!(
            "[[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
             [[threads]]\nname = \"fast\"\n[[threads]]\nname = \"slow\"\n{pipelines}"
        ),
    );
    let replay = || {
        let mut daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
        daemon.await_error("serving");
        let mut replayer = Replayer::open(&site.host(), train, Rate::Max).unwrap();
        assert!(replayer.await_daemon(Duration::from_secs(10)), "{}", daemon.errors());
        dataset.runs.iter().for_each(|run| replayer.play(&run.samples, |_| {}));
        let report = replayer.finish();
        daemon.end(Signal::TERM);
        report
    };
    // On a machine so busy that samples are lost, the samples were not the same: once more.
    let is_whole = |it: &ReplayReport| it.snapshots.iter().all(|it| it.samples_lost == 0);
    let report = (0..5).map(|_| replay()).find(is_whole).expect("a replay without loss");

    assert_eq!(report.published, samples.len() as u64);
    assert_eq!(report.snapshots.len(), estimators.len());
    for settings in &estimators {
        let kind = settings.kind();
        let offline = without_stamps(identify(&dataset, &samples, settings).unwrap().snapshot());
        let number = kind as u32;
        let online = report.snapshots.iter().find(|it| it.pipeline_kind == number).unwrap();
        let online = without_stamps(online);
        assert_eq!(bits(&online), bits(&offline), "{kind}");
        assert_eq!(online, offline, "{kind}");
        assert_eq!(online.samples_lost, 0, "{kind}");
        assert_eq!(
            online.samples_used + online.samples_rejected,
            report.published,
            "{kind}: every sample is accounted for"
        );
    }
}
