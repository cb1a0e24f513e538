//! Gradient from the altitude along the way.

/// Altitudes are averaged over stretches of this many m, so that a standing train does not
/// outweigh a fast one.
const CELL_M: f64 = 10.0;
/// The gradient at a place is fitted over so many m to either side. Altitudes in whole metres
/// make a slope over 2 * 150 m wrong by 1 ‰ (one standard deviation).
const HALF_WINDOW_M: f64 = 150.0;
/// A fit over fewer m than this says nothing.
const SPAN_MIN_M: f64 = 100.0;

/// Gradient in ‰ at every row, climbing positive as the chainage grows, `NaN` where unknown:
/// the slope of the straight line fitted by least squares to the altitudes around the place.
///
/// Positions and altitudes are in m, `NaN` where missing.
pub(super) fn gradient_permille(position_m: &[f64], altitude_m: &[f64]) -> Vec<f64> {
    let cells = cells(position_m, altitude_m);
    let slopes = slopes(&cells);
    position_m
        .iter()
        .map(|&position| {
            let cell = cells.binary_search_by(|cell| cell.number.cmp(&cell_number(position)));
            cell.map_or(f64::NAN, |cell| 1000.0 * slopes[cell])
        })
        .collect()
}

/// The mean altitude over a stretch of [`CELL_M`].
struct Cell {
    number: i64,
    position_m: f64,
    altitude_m: f64,
}

fn cell_number(position_m: f64) -> i64 {
    (position_m / CELL_M).floor() as i64
}

/// The cells that hold altitudes, by chainage.
fn cells(position_m: &[f64], altitude_m: &[f64]) -> Vec<Cell> {
    let mut points: Vec<(f64, f64)> = position_m
        .iter()
        .zip(altitude_m)
        .filter(|(position, altitude)| !position.is_nan() && !altitude.is_nan())
        .map(|(&position, &altitude)| (position, altitude))
        .collect();
    points.sort_by(|one, other| one.0.total_cmp(&other.0));
    let same_cell =
        |one: &(f64, f64), other: &(f64, f64)| cell_number(one.0) == cell_number(other.0);
    points
        .chunk_by(same_cell)
        .map(|points| {
            let mean = |value: fn(&(f64, f64)) -> f64| {
                points.iter().map(value).sum::<f64>() / points.len() as f64
            };
            Cell {
                number: cell_number(points[0].0),
                position_m: mean(|point| point.0),
                altitude_m: mean(|point| point.1),
            }
        })
        .collect()
}

/// The slope at every cell, fitted over the window around it.
fn slopes(cells: &[Cell]) -> Vec<f64> {
    let (mut from, mut to) = (0, 0);
    cells
        .iter()
        .map(|centre| {
            while cells[from].position_m < centre.position_m - HALF_WINDOW_M {
                from += 1;
            }
            while to < cells.len() && cells[to].position_m <= centre.position_m + HALF_WINDOW_M {
                to += 1;
            }
            slope(&cells[from..to])
        })
        .collect()
}

fn slope(cells: &[Cell]) -> f64 {
    let (first, last) = (&cells[0], &cells[cells.len() - 1]);
    if last.position_m - first.position_m < SPAN_MIN_M {
        return f64::NAN;
    }
    let mean = |value: fn(&Cell) -> f64| cells.iter().map(value).sum::<f64>() / cells.len() as f64;
    let (mean_position, mean_altitude) =
        (mean(|cell| cell.position_m), mean(|cell| cell.altitude_m));
    let (mut covariance, mut variance) = (0.0, 0.0);
    for cell in cells {
        let distance = cell.position_m - mean_position;
        covariance += distance * (cell.altitude_m - mean_altitude);
        variance += distance * distance;
    }
    covariance / variance
}
