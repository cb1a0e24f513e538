//! Published tables of stopping distances over speed and gradient, read as the law of a brake.

use std::array::from_fn;

use dynocar_core::filter::levenberg_marquardt::{
    LeastSquares, Linearisation, ParameterBox, SolverSettings, minimise,
};
use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use dynocar_shared::{BrakeResponse, EffortPoint, Stop};
use nalgebra::SVector;
use serde::Serialize;

use crate::statistics::share_of;
use crate::stops::{DecelerationLaw, Gradient};

/// Speeds at which the deceleration of a table is free, as shares of the fastest.
const KNOTS: [f64; 6] = [0.0, 0.08, 0.2, 0.4, 0.7, 1.0];
/// Head line of a table.
pub const HEAD: &str = "brake_curve,speed_kph,grade_1_in_x,stopping_distance_m";
/// Number of free parameters: the traction's cut-off, the build-up, the rotating mass, and a deceleration at each knot.
const FREE: usize = 3 + KNOTS.len();
/// Relative error of a row beyond which it counts more than by its square, so that no row is sacrificed to the others.
const ROW_ERROR: f64 = 0.01;
/// Dead times and build-ups in s from which the search starts.
const STARTS_S: [(f64, f64); 4] = [(0.5, 1.0), (0.5, 6.0), (1.0, 20.0), (0.5, 60.0)];

/// A row of a table: from a speed on a gradient to standstill.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StoppingTableRow {
    /// Speed in m/s at the command.
    pub from_mps: f64,
    /// Gradient in ‰, climbing positive.
    pub gradient_permille: f64,
    /// Distance in m.
    pub distance_m: f64,
}

/// A brake that stops as a table says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableLaw {
    /// The brake's name in the table.
    pub name: String,
    /// How many rows.
    pub rows: usize,
    /// Time in s after the command at the speed of the command, as tables count it.
    pub traction_cut_off_s: f64,
    /// Time in s over which the brake grows to its full force.
    pub build_up_s: f64,
    /// gamma: how much less a gradient acts than on a train without rotating parts.
    pub rotating_mass_factor: f64,
    /// Speeds in m/s and decelerations in m/s² on the level.
    pub decelerations: Vec<[f64; 2]>,
    /// Half of the rows are reproduced within this share.
    pub error_median: f64,
    /// 95 % of the rows are reproduced within this share.
    pub error_95: f64,
    /// The worst row is reproduced within this share.
    pub error_max: f64,
}

struct Fit<'r> {
    rows: &'r [StoppingTableRow],
    knots_mps: [f64; KNOTS.len()],
    /// The worst row's error over [`ROW_ERROR`], which is pressed down; infinite before there is one.
    worst: f64,
}

type Point = SVector<f64, FREE>;

impl Fit<'_> {
    fn distance_m(&self, point: &Point, row: &StoppingTableRow) -> Option<f64> {
        let inertia = 1.0 + point[2];
        let effort: [EffortPoint; KNOTS.len()] = from_fn(|k| EffortPoint {
            speed_mps: self.knots_mps[k],
            force_n: inertia * point[3 + k],
        });
        let stop = Stop {
            rotating_mass_factor: point[2],
            gradient_permille: row.gradient_permille,
            response: BrakeResponse {
                traction_cut_off_s: point[0],
                build_up_s: point[1],
                ..BrakeResponse::IMMEDIATE
            },
            ..Stop::level(row.from_mps, 1.0, [0.0; 3], &effort)
        };
        Some(stop.estimate(0.5).ok()?.distance_m)
    }

    fn residual(&self, point: &Point, row: &StoppingTableRow) -> Option<f64> {
        let error = (self.distance_m(point, row)? / row.distance_m).ln() / ROW_ERROR;
        let pressed = 1.0 + 10.0 * (error / self.worst).powi(8);
        Some(error * (1.0 + error * error).sqrt() * pressed)
    }
}

impl LeastSquares<FREE> for Fit<'_> {
    fn linearise(&mut self, point: &Point) -> Option<Linearisation<FREE>> {
        let mut gathered = TriangularAccumulator::<{ FREE + 1 }>::default();
        let mut cost = 0.0;
        for row in self.rows {
            let at = self.residual(point, row)?;
            cost += 0.5 * at * at;
            let mut line = [at; FREE + 1];
            for (k, slope) in line[..FREE].iter_mut().enumerate() {
                let mut moved = *point;
                let step = 1e-4 * (1.0 + point[k].abs());
                moved[k] += step;
                *slope = (self.residual(&moved, row)? - at) / step;
            }
            gathered.push(&line);
        }
        let system = TriangularSystem::from_rows(&mut gathered);
        Some(Linearisation { cost, system, nested_decrease: 0.0 })
    }
}

impl TableLaw {
    /// Returns the brake behind some rows; `None` for rows that no brake gives.
    pub fn new(name: &str, rows: &[StoppingTableRow]) -> Option<Self> {
        let fastest_mps = rows.iter().map(|row| row.from_mps).fold(0.0, f64::max);
        let knots_mps = KNOTS.map(|share| share * fastest_mps);
        let mut fit = Fit { rows, knots_mps, worst: f64::INFINITY };
        let bounds = ParameterBox {
            low: Point::from_fn(|k, _| if k < 3 { 0.0 } else { 0.05 }),
            high: Point::from_fn(|k, _| [60.0, 200.0, 0.3].get(k).copied().unwrap_or(5.0)),
        };
        let start = |(dead_s, build_up_s): (f64, f64)| {
            Point::from_fn(|k, _| [dead_s, build_up_s, 0.05].get(k).copied().unwrap_or(0.7))
        };
        let settings = SolverSettings {
            scales: Point::from_fn(|k, _| [1.0, 1.0, 0.05].get(k).copied().unwrap_or(0.1)),
            iterations_max: 60,
            decrease_tolerance: 1e-4,
            relative_tolerance: 1e-6,
        };
        let found = STARTS_S
            .iter()
            .filter_map(|it| minimise(&mut fit, &start(*it), &bounds, &settings))
            .min_by(|one, other| one.linearisation.cost.total_cmp(&other.linearisation.cost))?;
        let off = |row| Some((fit.distance_m(&found.point, row)? / row.distance_m).ln().abs());
        let worst = rows.iter().filter_map(off).fold(0.0, f64::max).max(ROW_ERROR);
        fit.worst = worst / ROW_ERROR;
        let pressed = minimise(&mut fit, &found.point, &bounds, &settings)?;
        let point = &pressed.point;
        let errors = rows.iter().map(|row| {
            let distance_m = fit.distance_m(point, row)?;
            Some((distance_m / row.distance_m - 1.0).abs())
        });
        let errors: Vec<f64> = errors.collect::<Option<_>>()?;
        Some(TableLaw {
            name: name.into(),
            rows: rows.len(),
            traction_cut_off_s: point[0],
            build_up_s: point[1],
            rotating_mass_factor: point[2],
            decelerations: fit
                .knots_mps
                .iter()
                .enumerate()
                .map(|(k, v)| [*v, point[3 + k]])
                .collect(),
            error_median: share_of(&errors, 0.5),
            error_95: share_of(&errors, 0.95),
            error_max: share_of(&errors, 1.0),
        })
    }
}

/// Returns the tables of a text with the head `brake_curve,speed_kph,grade_1_in_x,stopping_distance_m`, by their names;
/// a gradient is `Level` or the x of 1 in x, negative falling.
///
/// # Errors
///
/// Names the row, and the expected value.
pub fn parse(text: &str) -> Result<Vec<(String, Vec<StoppingTableRow>)>, String> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let head = lines.next().map(|it| it.1.trim().trim_start_matches('\u{feff}'));
    if head != Some(HEAD) {
        return Err(format!("line 1: expected the head {HEAD}, got {}", head.unwrap_or("nothing")));
    }
    let mut tables: Vec<(String, Vec<StoppingTableRow>)> = Vec::new();
    for (index, line) in lines {
        let expects = |what: &str| format!("line {}: {line}: expected {what}", index + 1);
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let [name, speed, gradient, distance] = cells[..] else { return Err(expects("4 cells")) };
        let number = |cell: &str, what: &str, most: f64| {
            let number: f64 = cell.parse().map_err(|_| expects(what))?;
            (number.abs() > 0.0 && number.abs() <= most)
                .then_some(number)
                .ok_or_else(|| expects(what))
        };
        let positive = |cell: &str, what: &str, most: f64| {
            number(cell, what, most)
                .and_then(|it| (it > 0.0).then_some(it).ok_or_else(|| expects(what)))
        };
        let gradient_permille = match gradient {
            "Level" => 0.0,
            steep => 1000.0 / number(steep, "Level or a gradient of 1 in x, x from 5", 1e6)?,
        };
        if gradient_permille.abs() > 200.0 {
            return Err(expects("Level or a gradient of 1 in x, x from 5"));
        }
        let row = StoppingTableRow {
            from_mps: positive(speed, "a speed in km/h above 0, at most 700", 700.0)? / 3.6,
            gradient_permille,
            distance_m: positive(distance, "a distance in m above 0", 1e5)?,
        };
        match tables.iter_mut().find(|it| it.0 == name) {
            Some((_, rows)) => rows.push(row),
            None => tables.push((name.into(), vec![row])),
        }
    }
    if tables.is_empty() {
        return Err("line 2: expected a row of 4 cells, got nothing".into());
    }
    Ok(tables)
}

/// The gradients of published tables: 1 in x, climbing positive.
const GRADIENTS: [f64; 14] = [
    33.0, 40.0, 60.0, 100.0, 200.0, 300.0, 600.0, -600.0, -300.0, -200.0, -100.0, -60.0, -40.0,
    -33.0,
];

/// Returns the distances that 95 % of stops of a law keep, as a table of the same form, without the speeds that the law
/// does not reach and the gradients on which it does not stop.
pub fn write(name: &str, law: &DecelerationLaw, rotating_mass_factor: f64) -> String {
    let name: String = name.chars().filter(|it| !matches!(it, ',' | '\n' | '\r' | '"')).collect();
    let mut text = format!("{HEAD}\n");
    for speed_kmh in
        (1..).map(|step| 10 * step).take_while(|it| f64::from(*it) / 3.6 <= law.fastest_mps())
    {
        let mut row = |gradient: &str, permille: f64| {
            let gradients = Gradient { permille, rotating_mass_factor };
            if let Some(it) = law.stopping_distance(f64::from(speed_kmh) / 3.6, &gradients) {
                text +=
                    &format!("{name},{speed_kmh},{gradient},{:.0}\n", it.distance_bound_m.ceil());
            }
        };
        row("Level", 0.0);
        for steep in GRADIENTS {
            row(&steep.to_string(), 1000.0 / steep);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_law_behind_a_table_is_found_and_a_wrong_row_is_named() {
        let mut rows = Vec::new();
        for (speed, permille) in
            (1..=16).flat_map(|k| [-20.0, -5.0, 0.0, 10.0].map(|it| (2.0 * f64::from(k), it)))
        {
            let effort = [
                EffortPoint { speed_mps: 0.0, force_n: 1.1 },
                EffortPoint { speed_mps: 32.0, force_n: 0.8 },
            ];
            let response = BrakeResponse {
                traction_cut_off_s: 1.0,
                build_up_s: 4.0,
                ..BrakeResponse::IMMEDIATE
            };
            let stop = Stop {
                rotating_mass_factor: 0.06,
                gradient_permille: permille,
                response,
                ..Stop::level(speed, 1.0, [0.0; 3], &effort)
            };
            let distance_m = stop.estimate(0.5).unwrap().distance_m;
            rows.push(StoppingTableRow {
                from_mps: speed,
                gradient_permille: permille,
                distance_m,
            });
        }
        let law = TableLaw::new("true", &rows).unwrap();
        assert!(law.error_max < 0.01, "{law:?}");
        let lost_s = law.traction_cut_off_s + 0.5 * law.build_up_s;
        assert!((lost_s - 3.0).abs() < 0.3, "{law:?}");
        let text = format!("{HEAD}\nA,10,33,14\nA,10,Level,15\n");
        assert_eq!(parse(&text).unwrap()[0].1.len(), 2);
        for (row, expected) in
            [("A,0,33,14", "a speed"), ("A,10,3,14", "1 in x"), ("A,10,33", "4 cells")]
        {
            let words = parse(&format!("{HEAD}\n{row}\n")).unwrap_err();
            assert!(words.contains("line 2") && words.contains(expected), "{words}");
        }
    }
}
