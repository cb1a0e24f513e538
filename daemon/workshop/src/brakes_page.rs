//! The parameters of a brake as one page of HTML.

use std::fmt::Write as _;

use dynocar_analysis::brakes::{Basis, BrakeParameters, Correction, EtcsBrake};
use dynocar_analysis::stops::DecelerationLaw;
use serde::Serialize;

use crate::report::html::ColumnAlignment::{Numbers, Words};
use crate::report::html::{self, TableColumns, escape, table};
use crate::report::page::document;
use crate::report::provenance::Provenance;

/// Width and height of the picture.
const SIZE: (f64, f64) = (980.0, 380.0);
/// Margin for the numbers at the left of the picture and below it.
const MARGIN: f64 = 50.0;

/// Reported results.
#[derive(Debug, Serialize)]
pub struct BrakesAnswer {
    /// Names of the datasets.
    pub datasets: Vec<String>,
    /// Number of stops that the parameters rest on, and number of all stops.
    pub stops: [usize; 2],
    /// The law of the stops by all of the brake.
    pub law: DecelerationLaw,
    /// The parameters.
    pub parameters: BrakeParameters,
    /// The same as OSRD's `etcs_brake_params`.
    pub etcs: EtcsBrake,
    /// Source of each of its values.
    pub rests_on: Vec<Basis>,
    /// The level of Kdry_rst in the file.
    pub ebcl: Option<u32>,
    /// Statements about the parameters and their limits.
    pub said: Vec<String>,
}

/// Columns of Kdry_rst.
pub const K_DRY: TableColumns<Correction> = &[
    ("EBCL", |it| it.ebcl.to_string()),
    ("one stop in", |it| format!("{:.0e}", 1.0 / it.probability)),
    ("measured", |it| share(it.measured)),
    ("95 % from", |it| share(it.measured_95[0])),
    ("to", |it| share(it.measured_95[1])),
    ("components", |it| share(it.modelled)),
    ("Kdry_rst", |it| share(it.k_dry())),
];

/// Columns of the table of the sources of values.
const RESTS_ON: TableColumns<Basis> = &[
    ("value", |it| it.key.into()),
    ("", |it| if it.is_guess { "a guess" } else { "" }.into()),
    ("rests on", |it| it.rests_on.clone()),
];

fn share(share: Option<f64>) -> String {
    share.map_or("-".into(), |it| format!("{it:.3}"))
}

fn as_html<T>(
    caption: &str,
    columns: TableColumns<T>,
    column: html::ColumnAlignment,
    rows: &[T],
) -> String {
    let cells: Vec<_> = columns.iter().map(|it| move |row: &T| escape(&it.1(row))).collect();
    let columns: Vec<html::TableColumn<'_, T>> = columns
        .iter()
        .zip(&cells)
        .map(|(it, cell)| (it.0, column, cell as &dyn Fn(&T) -> String))
        .collect();
    table(caption, &columns, rows)
}

/// Returns the page: decelerations over speed, steps, corrections, and their limits.
pub fn html(answer: &BrakesAnswer, made: &Provenance) -> String {
    let name = escape(&answer.datasets.join(", "));
    let header = format!(
        "<p class=\"kicker\">Dynocar · brake</p>\n<h1>{name}</h1>\n<p class=\"facts\">{} of {} stops by all \
         of the brake · {}</p>\n",
        answer.stops[0], answer.stops[1], made.day
    );
    let mut main = String::new();
    let mut section = |id: &str, title: &str, body: &str| main += &html::section(id, title, body);
    section("curve", "Deceleration over speed", &picture(answer));
    let steps = &answer.parameters.emergency;
    let starts = std::iter::once(0.0).chain(steps.boundaries.iter().copied());
    let rows: Vec<(f64, f64)> = starts.zip(steps.values.iter().copied()).collect();
    let body = table(
        "A_brake_emergency",
        &[
            ("from m/s", Numbers, &|it: &(f64, f64)| format!("{:.1}", it.0)),
            ("m/s²", Numbers, &|it: &(f64, f64)| format!("{:.3}", it.1)),
        ],
        &rows,
    );
    section("steps", "Steps below the curve", &body);
    let body = as_html("Kdry_rst by level of confidence", K_DRY, Numbers, &answer.parameters.k_dry);
    section("corrections", "How far stops fall short of the mean", &body);
    let body = as_html("Values of the file for OSRD", RESTS_ON, Words, &answer.rests_on);
    section("rests", "What each value rests on", &body);
    let body = table(
        "What holds, and what does not",
        &[("", Words, &|it: &String| escape(it))],
        &answer.said,
    );
    section("said", "No safety case", &body);
    document(&format!("{name} – brake"), &header, &main, made)
}

fn picture(answer: &BrakesAnswer) -> String {
    let (law, parameters) = (&answer.law, &answer.parameters);
    let top = 1.1 * law.points.iter().map(|it| it.deceleration_mps2).fold(0.1, f64::max);
    let fastest = law.fastest_mps();
    let x = |speed: f64| MARGIN + (SIZE.0 - 2.0 * MARGIN) * speed / fastest;
    let y = |value: f64| SIZE.1 - MARGIN - (SIZE.1 - 2.0 * MARGIN) * value / top;
    let path = |points: &[(f64, f64)]| {
        let mut path = String::new();
        for (k, (speed, value)) in points.iter().enumerate() {
            let _ =
                write!(path, "{}{:.1},{:.1}", if k == 0 { "M" } else { "L" }, x(*speed), y(*value));
        }
        path
    };
    let mean: Vec<(f64, f64)> =
        law.points.iter().map(|it| (it.speed_mps, it.deceleration_mps2)).collect();
    let bound: Vec<(f64, f64)> = parameters.bound.iter().map(|it| (it[0], it[1])).collect();
    let mut steps = Vec::new();
    let (starts, ends) = (&parameters.emergency.boundaries, &parameters.emergency.boundaries);
    let starts = std::iter::once(0.0).chain(starts.iter().copied());
    let ends = ends.iter().copied().chain([fastest]);
    for ((from, to), value) in starts.zip(ends).zip(&parameters.emergency.values) {
        steps.extend([(from, *value), (to, *value)]);
    }
    let mut svg = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"Deceleration over speed: mean, \
         bound and steps\">\n",
        SIZE.0, SIZE.1
    );
    for (line, colour, width) in [(&mean, "after", 2), (&bound, "muted", 1), (&steps, "before", 3)]
    {
        let _ = writeln!(
            svg,
            "<path d=\"{}\" fill=\"none\" stroke=\"var(--{colour})\" stroke-width=\"{width}\"/>",
            path(line)
        );
    }
    let mut word = |at: (f64, f64), words: String| {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"var(--muted)\" font-size=\"15\">{words}</text>",
            at.0, at.1
        );
    };
    for k in 0..=4 {
        let share = f64::from(k) / 4.0;
        word((x(share * fastest) - 10.0, SIZE.1 - 20.0), format!("{:.0}", share * fastest));
        word((4.0, y(share * top) + 5.0), format!("{:.2}", share * top));
    }
    word((SIZE.0 - 40.0, SIZE.1 - 20.0), "m/s".into());
    word((4.0, 20.0), "m/s²".into());
    svg + "</svg>\n<p class=\"note\">Thin: the mean of the stops, and the bound that it lies above; thick: the \
           steps.</p>\n"
}
