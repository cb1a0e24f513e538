//! Recordings of other people's tools: the values of one train in other forms give the same samples as in the plain
//! form.

use std::fmt::Write as _;

use dynocar::dataset::load;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::dataset::text_layout::by_name;
use dynocar_tests::process::DaemonSite;

pub const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
pub const NAMES: [&str; 6] =
    ["time_s", "position_m", "speed_mps", "traction_force_n", "brake_force_n", "gradient_permille"];
pub const ROWS: u32 = 600;

/// Returns the values of a row in the order of [`NAMES`]: a train that accelerates, coasts and brakes, over hills.
pub fn values(row: u32) -> [f64; 6] {
    let time = f64::from(row) * 0.2;
    let speed = if time < 60.0 { 0.2 * time } else { 12.0 - 0.15 * (time - 60.0) };
    let position = if time < 60.0 {
        0.1 * time * time
    } else {
        360.0 + 12.0 * (time - 60.0) - 0.075 * (time - 60.0).powi(2)
    };
    let (traction, brake) = if time < 60.0 { (41_000.5, 0.0) } else { (0.0, 26_000.25) };
    [time, 1000.0 + position, speed, traction, brake, 4.0 * (position / 200.0).sin()]
}

/// Returns a file of these columns; `cell` writes each cell.
pub fn table(names: &[&str], delimiter: &str, cell: impl Fn(u32, usize) -> String) -> String {
    let mut text = names.join(delimiter) + "\n";
    for row in 0..ROWS {
        let cells: Vec<String> = (0..names.len()).map(|column| cell(row, column)).collect();
        let _ = writeln!(text, "{}", cells.join(delimiter));
    }
    text
}

pub fn plain(row: u32, column: usize) -> String {
    values(row)[column].to_string()
}

/// Describes files by `init`; gives the dataset, and the words of the command.
pub fn described(
    files: &[(&str, &[u8])],
    more: &[&str],
) -> (DaemonSite, Result<Dataset, String>, String) {
    let site = DaemonSite::new();
    let mut arguments: Vec<String> =
        vec!["init".into(), site.path().join("ds").display().to_string(), "--csv".into()];
    for (name, bytes) in files {
        let path = site.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        arguments.push(path.display().to_string());
    }
    if !more.contains(&"--mass-t") {
        arguments.extend(["--mass-t", "150", "--length-m", "80"].map(String::from));
    }
    arguments.extend(more.iter().map(|it| (*it).to_owned()));
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut process = site.start(DYNOCAR, &arguments);
    let is_done = process.wait().success();
    let (said, errors) = (process.output(), process.errors());
    let read = match is_done {
        true => load(&site.path().join("ds")).map_err(|error| error.to_string()),
        false => Err(errors),
    };
    (site, read, said)
}

/// Requires the samples of the plain form.
pub fn assert_as_plain(
    name: &str,
    files: &[(&str, &[u8])],
    more: &[&str],
    tolerance: f64,
) -> String {
    let (_site, read, said) = described(files, more);
    let dataset = read.unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(dataset.runs.len(), files.len(), "{name}");
    for run in &dataset.runs {
        assert_eq!(run.samples.len(), ROWS as usize, "{name}");
        let first_s = run.samples[0].time_ns as f64 * 1e-9;
        for (row, sample) in (0..).zip(&run.samples) {
            let [time, position, speed, traction, brake, gradient] = values(row);
            let pairs = [
                (sample.time_ns as f64 * 1e-9 - first_s, time),
                (sample.position_m, position),
                (sample.speed_mps, speed),
                (sample.traction_force_n, traction),
                (sample.brake_force_n, brake),
                (sample.gradient_permille, gradient),
            ];
            for ((found, expected), what) in pairs.into_iter().zip(NAMES) {
                let near = tolerance * expected.abs().max(1.0);
                assert!(
                    (found - expected).abs() <= near,
                    "{name}, row {row}: {what} {found} for {expected}"
                );
            }
        }
    }
    said
}

#[test]
fn marks_of_thousands_are_read_wherever_they_stand() {
    let grouped = |value: f64, mark: &str, decimal: &str| {
        let text = format!("{:.4}", value.abs());
        let (whole, fraction) = text.split_once('.').expect("a point");
        let mut groups: Vec<&str> = Vec::new();
        let mut rest = whole;
        while rest.len() > 3 {
            let (head, tail) = rest.split_at(rest.len() - 3);
            groups.insert(0, tail);
            rest = head;
        }
        groups.insert(0, rest);
        let sign = if value < 0.0 { "-" } else { "" };
        format!("{sign}{}{decimal}{fraction}", groups.join(mark))
    };
    for (name, delimiter, mark, decimal) in [
        ("German", ";", ".", ","),
        ("Swiss", ";", "'", "."),
        ("narrow spaces", ";", "\u{202f}", ","),
        ("spaces", "\t", "\u{a0}", ","),
        ("typographic", ";", "’", "."),
        ("American, tabs", "\t", ",", "."),
    ] {
        let cell = |row: u32, column: usize| grouped(values(row)[column], mark, decimal);
        let text = table(&NAMES, delimiter, cell);
        assert_as_plain(name, &[("a.csv", text.as_bytes()), ("b.csv", text.as_bytes())], &[], 1e-3);
    }
    let quoted =
        |row: u32, column: usize| format!("\"{}\"", grouped(values(row)[column], ",", "."));
    assert_as_plain("American", &[("a.csv", table(&NAMES, ",", quoted).as_bytes())], &[], 1e-3);
}

#[test]
fn a_word_for_a_missing_value_is_missing_and_unmaps_nothing() {
    for word in [
        "n/a",
        "N/A",
        "#N/A",
        "NULL",
        "None",
        "<NA>",
        "-",
        "---",
        "1.#QNAN",
        "-1.#IND",
        "1.#INF",
        "1.#QNAN0",
        "nan(ind)",
        "#VALOR!",
        "#ZAHL!",
        "#NOMBRE?",
        "#####",
        "k.A.",
        "n.a.",
        "Bad Input",
        "I/O Timeout",
        "No Data",
        "----",
        "***",
        "error",
        "unknown",
    ] {
        let cell = |row: u32, column: usize| match (row, column) {
            (40..50, 3) => word.into(),
            (row, column) => plain(row, column),
        };
        let (_site, read, said) = described(&[("a.csv", table(&NAMES, ",", cell).as_bytes())], &[]);
        let dataset = read.unwrap_or_else(|error| panic!("{word}: {error}"));
        assert!(!said.contains("doubtful"), "{word}: {said}");
        let samples = &dataset.runs[0].samples;
        let force = dynocar_shared::SampleField::TractionForce;
        let missing = samples.iter().filter(|it| it.get(force).is_none()).count();
        assert_eq!((samples.len(), missing), (ROWS as usize, 10), "{word}");
        assert_eq!(samples[51].get(force), Some(41_000.5), "{word}");
    }
    // A word that stands for nothing known is named with its line.
    let cell = |row: u32, column: usize| {
        if (row, column) == (40, 3) { "much".into() } else { plain(row, column) }
    };
    let (_site, read, _) = described(&[("a.csv", table(&NAMES, ",", cell).as_bytes())], &[]);
    let message = read.unwrap_err();
    assert!(
        message.contains("a.csv:42: column 'traction_force_n': expected a number"),
        "{message}"
    );
    // A column may have the name of such a word.
    let names: Vec<&str> = NAMES.into_iter().chain(["fault", "error"]).collect();
    let cell = |row, column| if column < 6 { plain(row, column) } else { "0".into() };
    assert_as_plain("names", &[("a.csv", table(&names, ",", cell).as_bytes())], &[], 1e-9);
}

#[test]
fn what_tools_add_to_the_rows_is_left_out_in_one_file_and_in_several() {
    let text = table(&NAMES, ",", plain);
    let (names, rows) = text.split_once('\n').expect("names");
    let middle = rows.len() / 2 + rows[rows.len() / 2..].find('\n').expect("a row") + 1;
    let repeated = format!("{names}\n{}{names}\n{}", &rows[..middle], &rows[middle..]);
    for (name, text) in [
        ("footer", format!("{text}End of file\n")),
        ("footer with commas", format!("{text}Exported by,LoggerView,,,,\n")),
        ("names again", repeated),
        ("zeros", format!("{text}{}", "\0".repeat(4096))),
        ("control Z", format!("{text}\u{1a}")),
        ("blank lines", format!("\n{text}\n\n")),
        ("a line of units", format!("{names}\ns,m,m/s,N,N,\n{rows}")),
        ("units in brackets", format!("{names}\n[s],[m],[m/s],[N],[N],[permille]\n{rows}")),
    ] {
        let bytes = text.as_bytes();
        assert_as_plain(name, &[("a.csv", bytes)], &[], 1e-9);
        assert_as_plain(name, &[("a.csv", bytes), ("b.csv", bytes)], &[], 1e-9);
    }
    let twice: Vec<&str> = NAMES.into_iter().chain(["speed_mps"]).collect();
    let cell = |row, column| plain(row, if column == 6 { 2 } else { column });
    let text = table(&twice, ",", cell);
    for files in [
        &[("a.csv", text.as_bytes())][..],
        &[("a.csv", text.as_bytes()), ("b.csv", text.as_bytes())],
    ] {
        let message = described(files, &[]).1.unwrap_err();
        assert_eq!(message.matches("its name occurs 2 times").count(), 1, "{message}");
    }
}

#[test]
fn letters_of_other_encodings_are_read_where_they_are_named_and_else_said() {
    let names = |text: &str| text.split(';').map(str::to_owned).collect::<Vec<_>>();
    let columns = ["time", "position", "speed", "traction_force", "brake_force", "gradient"];
    let units = ["s", "m", "m/s", "N", "N", "permille"];
    for (header, encoding) in [
        ("Время;Путь;Скорость;Сила тяги;Тормозная сила;Уклон", "windows-1251"),
        ("时间;位置;速度;牵引力;制动力;坡度", "gbk"),
        ("時刻;位置;速度;力行力;制動力;勾配", "shift_jis"),
        ("Время;Путь;Скорость;Сила тяги;Тормозная сила;Уклон", "ibm866"),
        ("시간;위치;속도;견인력;제동력;기울기", "euc-kr"),
    ] {
        let header = names(header);
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let text = table(&header, ";", plain);
        let bytes = by_name(encoding).expect("an encoding").encode(&text).0;
        let given: Vec<String> = columns
            .iter()
            .zip(&header)
            .zip(units)
            .flat_map(|((quantity, name), unit)| {
                ["--column".into(), format!("{quantity}={name}:{unit}")]
            })
            .collect();
        let mut more = vec!["--encoding", encoding];
        more.extend(given.iter().map(String::as_str));
        assert_as_plain(encoding, &[("a.csv", &bytes)], &more, 1e-9);
        let message = described(&[("a.csv", &bytes)], &[]).1.unwrap_err();
        assert!(
            message.contains("the letters are taken for windows-1252")
                && message.contains("--encoding"),
            "{encoding}: {message}"
        );
    }
}

#[test]
fn truths_are_read_as_words_of_any_tool() {
    for (yes, no) in
        [("TRUE", "FALSE"), ("true", "false"), ("True", "False"), ("yes", "no"), ("WAHR", "FALSCH")]
    {
        let names: Vec<&str> = NAMES.into_iter().chain(["wheel_slide"]).collect();
        let cell = |row: u32, column: usize| match column {
            6 => (if row % 50 < 2 { yes } else { no }).to_owned(),
            _ => plain(row, column),
        };
        let (_site, read, _) = described(&[("a.csv", table(&names, ",", cell).as_bytes())], &[]);
        let dataset = read.unwrap_or_else(|error| panic!("{yes}: {error}"));
        let slides = dataset.runs[0].samples.iter().filter(|it| it.flags != 0).count();
        assert_eq!(slides, 24, "{yes}");
    }
}

#[test]
fn an_hour_of_summer_time_is_taken_out_and_said_with_its_line() {
    for (shift_s, words) in [
        (-3600.0, "went back by 3600 s in line 302"),
        (3600.0, "went forward by 3600 s in line 302"),
    ] {
        let clock = |row: u32| {
            let time = 10_000.0 + values(row)[0] + if row >= 300 { shift_s } else { 0.0 };
            let ms = (time * 1000.0).round() as u64;
            format!(
                "2026-10-25 {:02}:{:02}:{:02}.{:03}",
                ms / 3_600_000,
                ms / 60_000 % 60,
                ms / 1000 % 60,
                ms % 1000
            )
        };
        let names: Vec<&str> =
            std::iter::once("Timestamp").chain(NAMES.into_iter().skip(1)).collect();
        let cell = |row, column| if column == 0 { clock(row) } else { plain(row, column) };
        let text = table(&names, ",", cell);
        assert_as_plain(words, &[("a.csv", text.as_bytes())], &[], 1e-9);
        let (site, read, _) = described(&[("a.csv", text.as_bytes())], &[]);
        read.expect("a dataset");
        let folder = site.path().join("ds").display().to_string();
        for command in ["check", "identify", "explain"] {
            let mut process = site.start(DYNOCAR, &[command, &folder]);
            assert!(process.wait().success(), "{command}: {}", process.errors());
            let said = process.output().split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(said.contains(words) && said.contains("summer time"), "{command}: {said}");
        }
    }
}

#[test]
fn rows_in_any_order_are_sorted_and_an_index_without_a_name_is_a_time() {
    let text = table(&NAMES, ",", plain);
    let (names, rows) = text.split_once('\n').expect("names");
    let falling = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[1] = (5000.0 - cells[1].parse::<f64>().expect("a number")).to_string();
        cells.join(",")
    };
    let lines: Vec<String> = rows.lines().map(falling).collect();
    // Steps through all rows, as 7 is prime to their number; then back; then as parts of a table come.
    let orders: [Vec<usize>; 3] = [
        (0..600).map(|row| row * 7 % 600).collect(),
        (0..600).rev().collect(),
        (0..600).map(|row| (row / 150 * 150 + 300) % 600 + row % 150).collect(),
    ];
    for order in orders {
        let rows: Vec<&str> = order.iter().map(|&row| lines[row].as_str()).collect();
        let text = format!("{names}\n{}\n", rows.join("\n"));
        let (_site, read, _) = described(&[("a.csv", text.as_bytes())], &[]);
        let dataset = read.unwrap_or_else(|error| panic!("{error}"));
        let run = &dataset.runs[0];
        assert_eq!((run.direction, run.samples.len()), (-1, 600));
        assert!(
            run.samples.is_sorted_by(|one, next| one.time_ns < next.time_ns),
            "{:?}",
            &order[..3]
        );
        assert_eq!(run.samples[300].traction_force_n, 0.0);
        assert!(run.diagnostics.iter().any(|it| it.to_string().contains("order")));
    }
    let nameless = text.replacen("time_s", "", 1);
    assert_as_plain("index", &[("a.csv", nameless.as_bytes())], &["--column", "time=:s"], 1e-9);
    let message = described(&[("a.csv", nameless.as_bytes())], &[]).1.unwrap_err();
    assert!(message.contains("no column was recognised as time; the columns: ''"), "{message}");
}
