//! The page of `dynocar learn --report` in a real browser, at the widths of a desktop and a phone.

use std::path::PathBuf;
use std::process::Command;

use dynocar::models::origin::{EventWindow, HeldOutError};
use dynocar::models::records::ModelChoice;
use dynocar::models::{
    FoundEffect, MaintenanceEvent, ModelFigure, ModelHash, ModelText, NewDecision, NewModel,
    Origin, Store, TrainModels, UtcSecond,
};
use dynocar::shadow::record::{TrialRecord, TriedModel};
use dynocar_core::trial::Ledger;
use dynocar_core::trial::evidence::RivalEvidence;
use dynocar_model::simulate::SpeedError;
use dynocar_shared::TrainId;
use dynocar_tests::browser::Browser;
use dynocar_tests::process::DaemonSite;
use serde_json::json;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
/// Words that would do harm if they were taken for HTML.
const WORDS: &str = "<img src=x onerror=console.error(1)> & 'more'";

const LOOK: &str = r##"(() => {
    const width = document.documentElement.clientWidth;
    const all = selector => [...document.querySelectorAll(selector)];
    const cells = id => all(`#train-1-${id} tbody tr`).map(row =>
        [...row.children].map(cell => cell.textContent));
    return {
        inner_width: window.innerWidth,
        is_wider: document.documentElement.scrollWidth > width,
        sticking_out: all("body *").filter(element => element.getClientRects().length > 0)
            .filter(element => element.getBoundingClientRect().right > width + 1)
            .filter(element => !element.closest(".scroll")).map(element => element.outerHTML.slice(0, 200)),
        heading: document.querySelector("h1").textContent,
        sections: all("main > section h2").map(heading => heading.textContent),
        models: cells("models"),
        marked: all("#train-1-models tr.marked").length,
        decisions: cells("decisions"),
        events: cells("events"),
        plots: all("svg.plot").filter(plot => plot.getClientRects().length > 0)
            .map(plot => plot.getAttribute("aria-label")),
        open: document.querySelector("#train-1-open").innerText,
        is_odd: /NaN|undefined|inf\b/.test(document.body.innerText),
    };
})()"##;

fn put(models: &TrainModels, text: ModelText, parent: Option<ModelHash>, day: u64) -> ModelHash {
    let learned = parent.is_some();
    let figure = ModelFigure { value: 2.4e-4, std: 0.2e-4 };
    let effect = FoundEffect {
        kind: "tunnel_drag".into(),
        intervals_m: vec![[12_400.0, 13_650.0]],
        parameters: [("dc_n_per_kn".to_owned(), figure)].into(),
    };
    let origin = Origin {
        made: UtcSecond { unix_s: 1_767_225_600 + 86_400 * day },
        version: "0.1.0".into(),
        command: "dynocar learn".into(),
        parent,
        verdict: learned.then(|| "effect".into()),
        statement: WORDS.into(),
        dataset_sha256: None,
        error: learned.then_some(HeldOutError { before_mps: 0.842, after_mps: 0.317 }),
        effects: if learned { vec![effect] } else { Vec::new() },
        files: Vec::new(),
    };
    models.put(&NewModel { text, origin, answer_json: None, report_html: None }).unwrap()
}

/// A history: declared, a model adopted, one that grew from it, one rejected, an event.
fn history(site: &DaemonSite) -> (PathBuf, [ModelHash; 4]) {
    let config = site.write_config(1, "", "[[pipelines]]\nkind = \"residual_monitor\"\n");
    let train = std::fs::read_to_string(site.path().join("train.toml")).unwrap();
    let text = |more: &str| ModelText { train: format!("{train}{more}"), track: None };
    let models = Store::at(&site.path().join("models")).train(TrainId(1));
    let declared = put(&models, text(""), None, 0);
    let adopted = put(&models, text("# 1\n"), Some(declared), 3);
    let rejected = put(&models, text("# 2\n"), Some(declared), 5);
    let candidate = put(&models, text("# 3\n"), Some(adopted), 40);
    for (what, day) in [(ModelChoice::Adopt(adopted), 6), (ModelChoice::Reject(rejected), 7)] {
        let at = UtcSecond { unix_s: 1_767_225_600 + 86_400 * day };
        let (by, reason) = ("Anna".into(), WORDS.into());
        models.decide(&NewDecision { what, by, reason, at }).unwrap();
    }
    let window = EventWindow {
        run: "2026-01-20/runs/3.csv".into(),
        sha256: String::new(),
        t_start_s: 0.0,
        t_end_s: 600.0,
    };
    let event = MaintenanceEvent {
        kind: "dragging_brake".into(),
        found: UtcSecond { unix_s: 1_768_953_600 },
        acted: Some([UtcSecond { unix_s: 1_768_900_000 }; 2]),
        model: adopted,
        intervals_m: Vec::new(),
        sentence: "dragging brake in run 2026-01-20/runs/3.csv: n_per_kn = 2.10 ± 0.12".into(),
        size: [("n_per_kn".to_owned(), ModelFigure { value: 2.1, std: 0.06 })].into(),
        p_value: 1e-9,
        windows: vec![window],
    };
    models.put_event(&event).unwrap();
    let tried = |model, error_mps: f64| {
        let mut ledger = Ledger::default();
        for day in 0..12 {
            let sum_of_squares = 100.0 * error_mps.powi(2) * (1.0 + 0.05 * f64::from(day % 3));
            let error = SpeedError { sum_of_squares, count: 100 };
            ledger.book(error, f64::from(1_767_225_600 + 86_400 * day), None);
        }
        let last = UtcSecond { unix_s: 1_767_225_600 + 86_400 * 12 };
        let (error_ratio, estimates) = (Some([0.35, 0.44]), Vec::new());
        let (evidence, against) = (RivalEvidence::new(0.1), Some(adopted));
        let error_mps = Some(error_mps);
        TriedModel { model, last, against, error_mps, error_ratio, evidence, ledger, estimates }
    };
    let models_tried = vec![tried(declared, 0.61), tried(adopted, 0.24)];
    let trials = TrialRecord { in_force: Some(adopted), models: models_tried };
    trials.write(models.folder()).unwrap();
    std::fs::create_dir(site.path().join("runs")).unwrap();
    let page = site.path().join("history.html");
    let status = Command::new(DYNOCAR)
        .args(["learn", "--once", "--config"])
        .arg(config)
        .arg("--runs")
        .arg(site.path().join("runs"))
        .arg("--models")
        .arg(site.path().join("models"))
        .arg("--report")
        .arg(&page)
        .status()
        .expect("the program");
    assert!(status.success());
    (page, [declared, adopted, rejected, candidate])
}

#[test]
fn the_page_of_what_was_learned_shows_models_decisions_and_events_on_wide_and_narrow_screens() {
    let site = DaemonSite::new();
    let (page, hashes) = history(&site);
    let [declared, adopted, rejected, candidate] = hashes.map(|hash| hash.to_string());
    let mut browser = Browser::start(1280, false);
    for width_px in [1280, 390] {
        browser.show(width_px, width_px == 390);
        let address = format!("file://{}", page.display());
        browser.open(&address);
        let seen = browser.value(LOOK);
        let conduct = browser.conduct();
        assert_eq!(conduct.console_errors, [] as [String; 0]);
        assert_eq!(conduct.requests, [address]);
        assert_eq!(seen["inner_width"], width_px);
        assert_eq!(seen["is_wider"], false, "the page scrolls sideways: {seen:#}");
        assert_eq!(seen["sticking_out"], json!([]));
        assert_eq!(seen["is_odd"], false);
        assert_eq!(seen["heading"], "History of the models");
        let sections = [
            "Train 1: models",
            "Error by day",
            "Decisions",
            "Maintenance events",
            "Open questions",
        ];
        assert_eq!(seen["sections"], json!(sections));
        let cells = |row: usize| seen["models"][row].as_array().expect("a row").clone();
        let shown: Vec<(String, &str)> =
            [(0, "declared"), (1, "in force"), (2, "candidate"), (3, "rejected")]
                .map(|(row, state)| (cells(row)[0].as_str().unwrap().to_owned(), state))
                .into();
        // Each stands below the one that it grew from, and deeper.
        let expected = [
            (declared.clone(), "declared"),
            (format!("└\u{a0}{adopted}"), "in force"),
            (format!("\u{2003}└\u{a0}{candidate}"), "candidate"),
            (format!("└\u{a0}{rejected}"), "rejected"),
        ];
        assert_eq!(shown, expected);
        for (row, (_, state)) in expected.iter().enumerate() {
            assert_eq!(cells(row)[2], *state);
        }
        assert_eq!(cells(1)[3], "tunnel drag from km 12.40 to 13.65");
        assert_eq!((&cells(1)[4], &cells(1)[5]), (&json!("0.842"), &json!("0.317")));
        assert_eq!(seen["marked"], 1);
        let plots = seen["plots"].as_array().expect("plots");
        assert_eq!(plots.len(), 1, "one for each width: {plots:?}");
        let label = plots[0].as_str().expect("a label");
        assert!(label.contains("since 2026-01-01, 12 days"), "{label}");
        assert!(label.contains("another came in force 1 times"), "{label}");
        assert_eq!(seen["decisions"][0][1], "adopted");
        assert_eq!(
            (&seen["decisions"][0][4], &seen["decisions"][0][5]),
            (&json!("Anna"), &json!(WORDS))
        );
        assert_eq!(seen["events"].as_array().map(Vec::len), Some(1));
        assert!(seen["open"].as_str().unwrap().contains("None"));
    }
    let shown = Command::new(DYNOCAR)
        .args(["models", "list", "--models"])
        .arg(site.path().join("models"))
        .output()
        .expect("the program");
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(shown.contains("on trial: 0.35 to 0.44 times the error"), "{shown}");
    if let Some(kept) = std::env::var_os("DYNOCAR_KEEP_PAGE") {
        std::fs::copy(&page, kept).unwrap();
    }
}
