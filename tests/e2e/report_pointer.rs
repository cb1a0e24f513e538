//! The plots of a report under a mouse and a keyboard, in a real browser; and the same page without
//! scripts.

use dynocar_shared::TrainSample;
use dynocar_tests::browser::Browser;
use serde_json::{Value, json};

use crate::report::{OF_A_TUNNEL, open, page_of};

/// Brings a plot into the window; returns its box, the numbers below its axis with their places, and the visible text
/// next to it. `FIGURE` is replaced by a selector.
const LOOK: &str = r#"(() => {
    const figure = document.querySelector("FIGURE");
    const svg = [...figure.querySelectorAll("svg.plot")].find(svg => svg.getClientRects().length > 0);
    svg.scrollIntoView({ block: "center" });
    const area = svg.getBoundingClientRect();
    const isShown = element => element.getClientRects().length > 0;
    const labels = [...svg.querySelectorAll("text")].filter(isShown)
        .map(text => ({ text, box: text.getBoundingClientRect() }))
        .filter(({ text, box }) => /^[−\d.]+$/.test(text.textContent.trim()) && text.getAttribute("text-anchor") === "middle")
        .map(({ text, box }) => [Number(text.textContent.trim().replace("−", "-")), box.left + box.width / 2, box.top])
        .filter(([value, x]) => x > area.left + 30);
    const lowest = Math.max(...labels.map(label => label[2]));
    const output = figure.querySelector("output");
    const button = figure.querySelector("button");
    return {
        area: [area.left, area.top, area.width, area.height],
        labels: labels.filter(label => label[2] > lowest - 5).map(label => label.slice(0, 2)),
        reading: output && isShown(output) ? output.textContent.split("\n") : [],
        pointers: svg.querySelectorAll(".pointer").length,
        has_button: Boolean(button && isShown(button)),
    };
})()"#;

const TRACE: &str = "#error figure.trace";

/// A browser that shows the report.
fn opened() -> Browser {
    let mut browser = Browser::start(1280, false);
    open(&mut browser, &OF_A_TUNNEL.page);
    browser
}

fn look(browser: &mut Browser, figure: &str) -> Value {
    browser.value(&LOOK.replace("FIGURE", figure))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

/// A place of a plot in the window, as shares of its width and height.
fn place(seen: &Value, [across, down]: [f64; 2]) -> [f64; 2] {
    let [left, top, width, height] = [0, 1, 2, 3].map(|k| number(&seen["area"][k]));
    [left + across * width, top + down * height]
}

/// Returns the value of the numbers below a plot at a place.
fn by_labels(seen: &Value, x_px: f64) -> f64 {
    let labels = seen["labels"].as_array().unwrap();
    let [first, last] =
        [&labels[0], &labels[labels.len() - 1]].map(|label| (number(&label[0]), number(&label[1])));
    first.0 + (x_px - first.1) / (last.1 - first.1) * (last.0 - first.0)
}

/// The range of the numbers below a plot.
fn labelled(seen: &Value) -> f64 {
    let values = || seen["labels"].as_array().unwrap().iter().map(|label| number(&label[0]));
    values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
}

/// A number in a line of the reading that starts with a name.
fn read(seen: &Value, name: &str) -> f64 {
    let lines = seen["reading"].as_array().unwrap();
    let line = lines.iter().filter_map(Value::as_str).find_map(|line| line.strip_prefix(name));
    let line = line.unwrap_or_else(|| panic!("no {name} in {seen:#}"));
    let word = line.trim_start_matches(':').split_whitespace().next().unwrap();
    word.replace('−', "-").parse().unwrap_or_else(|_| panic!("{name}: a number, not {word}"))
}

#[test]
fn a_pointer_reads_what_was_recorded_and_a_drag_narrows_the_axis() {
    let mut browser = opened();
    let title =
        browser.value("document.querySelector('#error figure.trace figcaption').textContent");
    let file =
        title.as_str().unwrap().split([' ', ',']).find(|word| word.ends_with(".csv")).unwrap();
    let run = OF_A_TUNNEL.simulated.runs.iter().find(|run| run.plan.file() == file).unwrap();
    let time_s = |sample: &TrainSample| 1e-9 * sample.time_ns as f64;
    let seen = look(&mut browser, TRACE);
    assert_eq!(seen["reading"], json!([]), "nothing is shown before a pointer comes");
    let whole = labelled(&seen);
    let is_recorded = |seen: &Value, [x_px, _]: [f64; 2]| {
        let (at_s, speed_mps) = (read(seen, "Time in the recording"), read(seen, "measured"));
        let by_axis_s = by_labels(seen, x_px);
        assert!((at_s - by_axis_s).abs() < 0.01 * whole, "{at_s} s, {by_axis_s} s by the axis");
        // The picture holds every few seconds of the run, and a line in between.
        let near = || {
            let all = run.samples.iter().filter(|it| (time_s(it) - at_s).abs() < 0.004 * whole);
            all.map(|sample| sample.speed_mps)
        };
        let (low, high) = (near().fold(f64::MAX, f64::min), near().fold(f64::MIN, f64::max));
        assert!((low - 0.01..=high + 0.01).contains(&speed_mps), "{speed_mps} at {at_s} s");
        at_s
    };
    for across in [0.2, 0.37, 0.55, 0.9] {
        let at = place(&seen, [across, 0.3]);
        browser.mouse("mouseMoved", at, 0);
        let seen = look(&mut browser, TRACE);
        is_recorded(&seen, at);
        assert_eq!(seen["pointers"], 2, "in both charts");
        let (before, away) = (read(&seen, "before"), read(&seen, "before − measured"));
        assert!((before - read(&seen, "measured") - away).abs() < 0.02, "{seen:#}");
    }
    let (from, to) = (place(&seen, [0.4, 0.3]), place(&seen, [0.6, 0.3]));
    browser.mouse("mouseMoved", from, 0);
    browser.mouse("mousePressed", from, 1);
    browser.mouse("mouseMoved", to, 0);
    browser.mouse("mouseReleased", to, 1);
    let zoomed = look(&mut browser, TRACE);
    assert!(labelled(&zoomed) < 0.3 * whole, "{zoomed:#}");
    assert_eq!(zoomed["has_button"], true);
    let at = place(&zoomed, [0.5, 0.3]);
    browser.mouse("mouseMoved", at, 0);
    let narrowed = look(&mut browser, TRACE);
    let at_s = is_recorded(&narrowed, at);
    let ends_s = [from, to].map(|[x_px, _]| by_labels(&seen, x_px));
    assert!((ends_s[0]..ends_s[1]).contains(&at_s), "{at_s} in {ends_s:?}");
    for (kind, clicks) in
        [("mousePressed", 1), ("mouseReleased", 1), ("mousePressed", 2), ("mouseReleased", 2)]
    {
        browser.mouse(kind, at, clicks);
    }
    let again = look(&mut browser, TRACE);
    assert_eq!(again["labels"], seen["labels"], "a double click shows the whole");
    assert_eq!(again["has_button"], false);
    assert_eq!(browser.conduct().console_errors, [] as [String; 0]);
}

#[test]
fn keys_read_every_run_as_the_table_says_it() {
    let mut browser = opened();
    let table = browser.value(
        "[...document.querySelectorAll('#error details tbody tr')].map(row => [...row.children].map(cell => cell.textContent))",
    );
    const FIT_RUNS: &str = "#error .panels figure:nth-child(2)";
    browser.value(&format!("document.querySelector('{FIT_RUNS} svg').focus()"));
    let mut runs_read = Vec::new();
    for _ in 0..20 {
        browser.key("ArrowRight");
        let seen = look(&mut browser, FIT_RUNS);
        let run = read(&seen, "Run");
        let rows = table.as_array().unwrap();
        let row = rows.iter().find(|row| row[0].as_str() == Some(&run.to_string())).unwrap();
        for (name, k) in [("before", 3), ("after", 4)] {
            let printed: f64 = row[k].as_str().unwrap().parse().unwrap();
            assert!((read(&seen, name) - printed).abs() < 1.1e-3, "{name}: {printed} in {seen:#}");
        }
        runs_read.push(run as u32);
    }
    runs_read.dedup();
    assert!(runs_read.len() >= 2 && runs_read.is_sorted(), "{runs_read:?}");
    assert_eq!(runs_read.last(), Some(&8), "the last run is reached");
    browser.key("Escape");
    assert_eq!(look(&mut browser, FIT_RUNS)["reading"], json!([]));
}

#[test]
fn without_scripts_the_same_pictures_stand_and_no_address_is_named() {
    const PICTURES: &str = "[...document.querySelectorAll('svg.plot')].map(svg => [svg.innerHTML, svg.getBoundingClientRect().width])";
    let mut browser = opened();
    let with_scripts = browser.value(PICTURES);
    browser.forbid_scripts();
    open(&mut browser, &OF_A_TUNNEL.page);
    assert_eq!(browser.value("document.querySelectorAll('.hint, output, button').length"), 0);
    assert_eq!(browser.value(PICTURES), with_scripts);
    let text = &OF_A_TUNNEL.page;
    // The dataset is named as if it were a picture.
    let text_without_name = text.replace("&lt;img src=x", "");
    for foreign in ["://", " src=", "@import", "url(\"", "fetch", "XMLHttp", "WebSocket"] {
        assert!(!text_without_name.contains(foreign), "{foreign}");
    }
    // The same command makes the same page, but for the day.
    let again = page_of(&OF_A_TUNNEL.simulated);
    let without_day = |text: &str| {
        let (_, rest) = text.split_once("<footer>").unwrap();
        let day = rest.split_once(" on ").unwrap().1.split_once(". ").unwrap().0.to_string();
        text.replace(&day, "")
    };
    assert!(without_day(text) == without_day(&again), "the pages differ");
}
