//! The report of `dynocar explain` in a real browser, at the widths of a desktop and a phone, and its plots as files.
//! `report_pointer.rs` tests the pointer on its plots.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::LazyLock;

use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::browser::Browser;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{EffectRequest, SimulatedDataset, SimulatorSettings, simulate};
use serde_json::{Value, json};

/// Seed of a train whose runs are explained in a second.
const SEED: u64 = 23;
const DESKTOP_PX: u32 = 1280;
const PHONE_PX: u32 = 390;

/// A name that would do harm if it were taken for HTML.
const NAME: &str = "<img src=x onerror=console.error(1)> & 'line'";

/// Counts the required parts of a page, and lists elements that stick out of it or are too small to read.
const LOOK: &str = r#"(() => {
    const width = document.documentElement.clientWidth;
    const isShown = element => element.getClientRects().length > 0;
    const all = selector => [...document.querySelectorAll(selector)];
    const wider = element => element.getBoundingClientRect().right > width + 1;
    const plots = all("svg.plot").filter(isShown);
    const letters = plots.flatMap(plot => [...plot.querySelectorAll("text")]);
    return {
        width,
        inner_width: window.innerWidth,
        scroll_width: document.documentElement.scrollWidth,
        sticking_out: all("body *").filter(isShown).filter(wider)
            .filter(element => !element.closest(".scroll, svg")).map(element => element.outerHTML.slice(0, 200)),
        heading: document.querySelector("h1").textContent,
        title: document.title,
        language: document.documentElement.lang,
        sentence: document.querySelector(".sentence").textContent,
        sections: all("main > section h2").map(heading => heading.textContent),
        plots: plots.filter(plot => plot.getBoundingClientRect().height > 100).length,
        flat_plots: plots.filter(plot => plot.getBoundingClientRect().height <= 100).length,
        unlabelled: plots.filter(plot => plot.getAttribute("role") !== "img" || !plot.getAttribute("aria-label")).length,
        points: plots.reduce((sum, plot) => sum + plot.querySelectorAll("circle").length, 0),
        smallest_letters_px: Math.min(...letters.map(text => text.getBoundingClientRect().height)),
        line: document.querySelector('#line svg.plot').getAttribute('aria-label'),
        tables: all("table").filter(isShown).length,
        rows: all("tbody tr").length,
        not_a_number: /NaN|undefined|inf\b/.test(document.body.innerText),
        colours: [getComputedStyle(document.querySelector("main")).backgroundColor,
            getComputedStyle(plots[0].querySelector("text")).fill],
    };
})()"#;

/// A page, and the dataset that it was made of.
pub struct Report {
    pub page: String,
    pub simulated: SimulatedDataset,
}

/// A report of an effect, made once for all tests that look at it.
pub static OF_A_TUNNEL: LazyLock<Report> = LazyLock::new(|| report(&[EffectKind::TunnelDrag]));

/// Runs the command in a dataset's folder: nothing that it writes depends on where that lies.
fn explain(folder: &Path, page: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dynocar-under-test"))
        .current_dir(folder)
        .args(["explain", ".", "--report", page])
        .output()
        .expect("the program to start")
}

fn report(kinds: &[EffectKind]) -> Report {
    let simulated = simulate(&SimulatorSettings::new(SEED, EffectRequest::Kinds(kinds.to_vec())));
    Report { page: page_of(&simulated), simulated }
}

/// The page that the command makes of a dataset.
pub fn page_of(simulated: &SimulatedDataset) -> String {
    let folder = tempfile::tempdir().unwrap();
    write_dataset(simulated, folder.path()).unwrap();
    let manifest = folder.path().join("dataset.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    let named: Vec<String> = text
        .lines()
        .map(|line| match line.split_once('=') {
            Some((key, _)) if key.trim() == "name" => format!("name = {}", json!(NAME)),
            _ => line.into(),
        })
        .collect();
    std::fs::write(&manifest, named.join("\n")).unwrap();
    let output = explain(folder.path(), "report.html");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    // Standard error is no terminal here: no bar.
    assert_eq!(errors.lines().count(), 1, "{errors}");
    assert!(errors.starts_with("report: "), "{errors}");
    std::fs::read_to_string(folder.path().join("report.html")).unwrap()
}

/// Opens a page; gives its address.
pub fn open(browser: &mut Browser, page: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report.html");
    std::fs::write(&file, page).unwrap();
    let address = format!("file://{}", file.display());
    browser.open(&address);
    address
}

fn look(browser: &mut Browser, report: &Report, width_px: u32, is_dark: bool) -> Value {
    browser.show(width_px, is_dark);
    let address = open(browser, &report.page);
    let seen = browser.value(LOOK);
    let conduct = browser.conduct();
    assert_eq!(conduct.console_errors, [] as [String; 0]);
    assert_eq!(conduct.requests, [address]);
    assert_eq!(seen["inner_width"], width_px);
    assert_eq!(seen["scroll_width"], seen["width"], "the page scrolls sideways: {seen:#}");
    assert_eq!(seen["sticking_out"], json!([]));
    assert_eq!(seen["heading"], NAME);
    assert_eq!(seen["title"], format!("{NAME} – residual report"));
    assert_eq!(seen["language"], "en");
    assert_eq!(seen["unlabelled"], 0);
    assert_eq!(seen["flat_plots"], 0);
    assert_eq!(seen["not_a_number"], false);
    assert!(seen["smallest_letters_px"].as_f64().unwrap() >= 9.0, "{seen:#}");
    seen
}

const SECTIONS: [&str; 7] = [
    "Error before and after",
    "Along the line",
    "The residual force",
    "Parameters",
    "What else was considered",
    "Data quality",
    "How to reproduce",
];

#[test]
fn a_report_of_an_effect_renders_on_desktop_and_phone() {
    let mut browser = Browser::start(DESKTOP_PX, false);
    for width_px in [DESKTOP_PX, PHONE_PX] {
        let seen = look(&mut browser, &OF_A_TUNNEL, width_px, false);
        let sentence = seen["sentence"].as_str().unwrap();
        for words in ["tunnel drag", " km ", "95 % interval", "N/(m/s)²", "falls from"] {
            assert!(sentence.contains(words), "{words}: {sentence}");
        }
        assert_eq!(seen["sections"][0], "Verdict: Effect found");
        assert_eq!(seen["sections"].as_array().unwrap()[1..], SECTIONS.map(Value::from));
        let line = seen["line"].as_str().unwrap();
        for words in [
            "Height above the start, m from",
            "Gradient, ‰ from",
            "Curvature 1/R, 1/km from",
            "Found: tunnel drag from km ",
            "Missing resistance, growing chainage: at most",
            "Missing resistance, falling chainage: at most",
        ] {
            assert!(line.contains(words), "{words}: {line}");
        }
        // Runs, speeds of a run, covariates; before and after.
        assert!(seen["plots"].as_u64().unwrap() >= 2 + 1 + 4, "{seen:#}");
        assert!(seen["points"].as_u64().unwrap() > 100, "{seen:#}");
        assert!(seen["tables"].as_u64().unwrap() >= 4, "{seen:#}");
        assert!(seen["rows"].as_u64().unwrap() > 30, "{seen:#}");
    }
}

#[test]
fn a_report_of_nothing_follows_the_dark_scheme() {
    let report = report(&[]);
    let mut browser = Browser::start(DESKTOP_PX, false);
    let [light, dark] =
        [false, true].map(|is_dark| look(&mut browser, &report, DESKTOP_PX, is_dark));
    assert_eq!(light["sections"][0], "Verdict: Nothing undeclared");
    assert!(light["sentence"].as_str().unwrap().contains("Nothing undeclared acts"));
    assert!(light["plots"].as_u64().unwrap() >= 2 + 1 + 4, "{light:#}");
    assert!(!light["line"].as_str().unwrap().contains("Found"), "{light:#}");
    for k in [0, 1] {
        assert_ne!(light["colours"][k], dark["colours"][k]);
    }
}

#[test]
fn a_faulty_page_is_seen_to_be_faulty() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let text = "<!DOCTYPE html><body><div style='width: 900px'>wide</div>\
        <script>console.error('wrong'); fetch('http://127.0.0.1:9/x'); missing();</script>";
    std::fs::write(&page, text).unwrap();
    let mut browser = Browser::start(PHONE_PX, false);
    browser.open(&format!("file://{}", page.display()));
    let conduct = browser.conduct();
    let has = |words: &str| conduct.console_errors.iter().any(|error| error.contains(words));
    assert!(has("wrong") && has("missing is not defined"), "{conduct:?}");
    assert!(conduct.requests.contains(&"http://127.0.0.1:9/x".to_string()), "{conduct:?}");
    assert!(browser.value("document.documentElement.scrollWidth").as_u64() >= Some(900));
}

#[test]
fn a_report_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let simulated = simulate(&SimulatorSettings::new(SEED, EffectRequest::none()));
    write_dataset(&simulated, folder.path()).unwrap();
    let output = explain(folder.path(), "no/such/folder/report.html");
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("report.html: cannot be written"), "{errors}");
}

#[test]
fn every_plot_of_the_report_becomes_a_file_that_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let plots = folder.path().join("plots");
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let output = Command::new(env!("CARGO_BIN_EXE_dynocar-workshop-under-test"))
        .args(["explain".as_ref(), demo.as_os_str()])
        .args(["--plots".as_ref(), plots.as_os_str()])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(&plots).unwrap() {
        let path = entry.unwrap().path();
        let svg = std::fs::read_to_string(&path).unwrap();
        let named = format!("plot: {}\n", path.display());
        assert!(errors.contains(&named), "{named}{errors}");
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{named}");
        assert!(svg.contains("xmlns=\"http://www.w3.org/2000/svg\""), "{named}");
        assert!(!svg.contains("NaN") && svg.matches("<rect").count() >= 1, "{named}");
        names.push(path.file_name().unwrap().to_string_lossy().into());
    }
    assert_eq!(names.len(), errors.lines().count());
    assert!(names.iter().any(|name| name.starts_with("errors_")), "{names:?}");
    for name in ["residual_by_speed.svg", "residual_by_run.svg"] {
        assert!(names.iter().any(|other| other == name), "{name} {names:?}");
    }
}
