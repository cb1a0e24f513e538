//! Gradient from the altitude along the line.

/// Length in m of the intervals over which altitudes are averaged, so that a standing train does not outweigh a fast
/// one.
const CELL_M: f64 = 10.0;
/// Distance in m to either side over which the gradient at a place is fitted: wide enough for altitudes in whole
/// metres, which then leave an error of about 1 ‰, and not wider than gradients are long.
const HALF_WINDOW_M: f64 = 150.0;
/// Least distance in m that a fit covers.
const SPAN_MIN_M: f64 = 100.0;
/// Greatest distance in m between a place and the centre of the altitudes in its fit, under a long train.
const ASIDE_MAX_M: f64 = 30.0;
/// Least share of a long train that must stand on known ground.
const KNOWN_MIN: f64 = 0.9;

/// A train whose altitude was recorded.
pub(super) struct Recorded<'t> {
    /// Chainage of its centre in m, row by row.
    pub centre_m: &'t [f64],
    /// Chainage in m of the point whose altitude is recorded.
    pub point_m: &'t [f64],
    /// Altitude in m of that point.
    pub altitude_m: &'t [f64],
    /// Length in m.
    pub length_m: f64,
}

/// Returns the gradient in ‰ under a train at every row, climbing positive as the chainage grows, `NaN` where unknown:
/// the mean over its length of the slope of the straight line fitted by least squares to the altitudes around each
/// place.
///
/// Positions and altitudes are `NaN` where missing.
pub(super) fn gradient_permille(of: &Recorded) -> Vec<f64> {
    let cells = cells(of.point_m, of.altitude_m);
    let fits = fits(&cells, HALF_WINDOW_M);
    let half_m = 0.5 * of.length_m;
    let climb = Climb::new(&cells, (&fits, &self::fits(&cells, 2.0 * HALF_WINDOW_M)));
    let under = |centre_m: f64| {
        // A train no longer than a cell or two is a point.
        if half_m <= CELL_M {
            return nearest(&cells, centre_m).map(|cell| fits[cell].slope);
        }
        let (rear, front) = (climb.at(centre_m - half_m), climb.at(centre_m + half_m));
        let known_m = front.known_m - rear.known_m;
        (known_m >= KNOWN_MIN * of.length_m).then(|| (front.climbed_m - rear.climbed_m) / known_m)
    };
    let rows = of.centre_m.iter();
    rows.map(|&centre_m| 1000.0 * under(centre_m).unwrap_or(f64::NAN)).collect()
}

/// Returns the cell nearest to a place, when it lies within the window.
fn nearest(cells: &[Cell], position_m: f64) -> Option<usize> {
    let after = cells.partition_point(|cell| cell.position_m < position_m);
    let distance_m = |cell: &usize| (cells[*cell].position_m - position_m).abs();
    let candidates = after.checked_sub(1).into_iter().chain((after < cells.len()).then_some(after));
    let near = candidates.filter(|cell| distance_m(cell) <= HALF_WINDOW_M);
    near.min_by(|one, other| distance_m(one).total_cmp(&distance_m(other)))
}

/// Known ground up to a place, in m, and the metres climbed on it.
#[derive(Clone, Copy, Default)]
struct Climbed {
    at_m: f64,
    known_m: f64,
    climbed_m: f64,
}

/// The way climbed along the line, cell by cell.
struct Climb(Vec<Climbed>);

impl Climb {
    /// By the lines over a window and over one twice as wide. A line takes a share from a hill that grows by the square
    /// of the window: the two give the slope without it (Richardson 1911).
    fn new(cells: &[Cell], (fits, wide): (&[SlopeFit], &[SlopeFit])) -> Self {
        let is_around = |it: &SlopeFit| it.aside_m.abs() <= ASIDE_MAX_M;
        let all = cells.iter().zip(fits.iter().zip(wide));
        let known = all.filter(|(_, (fit, _))| is_around(fit)).map(|(cell, (fit, wide))| {
            let slope = match is_around(wide) {
                true => (4.0 * fit.slope - wide.slope) / 3.0,
                false => fit.slope,
            };
            (cell.position_m, slope)
        });
        let known: Vec<(f64, f64)> = known.collect();
        let mut all = Vec::with_capacity(known.len());
        let mut before =
            Climbed { at_m: known.first().map_or(0.0, |it| it.0), ..Climbed::default() };
        all.extend((!known.is_empty()).then_some(before));
        for pair in known.windows(2) {
            let ((from_m, from), (to_m, to)) = (pair[0], pair[1]);
            before.at_m = to_m;
            // Where altitudes are missing over a long way, nothing is known of it.
            if to_m - from_m <= HALF_WINDOW_M {
                before.known_m += to_m - from_m;
                before.climbed_m += 0.5 * (from + to) * (to_m - from_m);
            }
            all.push(before);
        }
        Climb(all)
    }

    /// Up to a place.
    fn at(&self, at_m: f64) -> Climbed {
        let after = self.0.partition_point(|it| it.at_m < at_m);
        let (Some(from), Some(to)) = (after.checked_sub(1).map(|it| self.0[it]), self.0.get(after))
        else {
            let end = if after == 0 { self.0.first() } else { self.0.last() };
            return end.copied().unwrap_or_default();
        };
        let share = (at_m - from.at_m) / (to.at_m - from.at_m);
        let between = |from: f64, to: f64| from + share * (to - from);
        Climbed {
            at_m,
            known_m: between(from.known_m, to.known_m),
            climbed_m: between(from.climbed_m, to.climbed_m),
        }
    }
}

/// A straight line fitted around a place.
struct SlopeFit {
    /// Its slope; `NaN` where too few altitudes are known.
    slope: f64,
    /// How far the middle of its altitudes lies from the place, in m; `NaN` without a slope.
    aside_m: f64,
}

/// The mean altitude over an interval of [`CELL_M`].
struct Cell {
    position_m: f64,
    altitude_m: f64,
}

fn cell_number(position_m: f64) -> i64 {
    (position_m / CELL_M).floor() as i64
}

/// Returns the cells that hold altitudes, by chainage.
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
            Cell { position_m: mean(|point| point.0), altitude_m: mean(|point| point.1) }
        })
        .collect()
}

/// Returns the line at every cell, fitted over the window around it.
fn fits(cells: &[Cell], half_window_m: f64) -> Vec<SlopeFit> {
    let (mut from, mut to) = (0, 0);
    cells
        .iter()
        .map(|centre| {
            while cells[from].position_m < centre.position_m - half_window_m {
                from += 1;
            }
            while to < cells.len() && cells[to].position_m <= centre.position_m + half_window_m {
                to += 1;
            }
            fit(&cells[from..to], centre.position_m)
        })
        .collect()
}

fn fit(cells: &[Cell], place_m: f64) -> SlopeFit {
    let (first, last) = (&cells[0], &cells[cells.len() - 1]);
    if last.position_m - first.position_m < SPAN_MIN_M {
        return SlopeFit { slope: f64::NAN, aside_m: f64::NAN };
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
    SlopeFit { slope: covariance / variance, aside_m: mean_position - place_m }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a train taken as a point.
    fn gradient_permille(position_m: &[f64], altitude_m: &[f64]) -> Vec<f64> {
        let point =
            Recorded { centre_m: position_m, point_m: position_m, altitude_m, length_m: 1.0 };
        super::gradient_permille(&point)
    }

    #[test]
    fn the_gradient_is_the_mean_under_the_train_wherever_the_altitude_is_recorded() {
        let hill_m = 493.0;
        for (length_m, direction) in [(100.0, 1.0), (400.0, -1.0), (740.0, 1.0), (740.0, -1.0)] {
            let head: Vec<f64> = (0..9000).map(|i| 10_000.0 + direction * f64::from(i)).collect();
            let altitude: Vec<f64> =
                head.iter().map(|s| 400.0 - 12e-3 * hill_m * (s / hill_m).cos()).collect();
            let centre: Vec<f64> = head.iter().map(|s| s - 0.5 * direction * length_m).collect();
            let found = super::gradient_permille(&Recorded {
                centre_m: &centre,
                point_m: &head,
                altitude_m: &altitude,
                length_m,
            });
            // The mean of a sine over a train.
            let half = 0.5 * length_m / hill_m;
            let truth = |s: &f64| 12.0 * (s / hill_m).sin() * half.sin() / half;
            let errors: Vec<f64> = found[1100..8600]
                .iter()
                .zip(&centre[1100..])
                .map(|(it, s)| it - truth(s))
                .collect();
            assert!(root_mean_square(&errors) < 0.01, "{}", root_mean_square(&errors));
            // Of the ground that it stands on at first, nobody knows the slope.
            let stands = (0.85 * length_m) as usize;
            assert!(found[..stands].iter().all(|it| it.is_nan()), "{length_m} m");
        }
    }

    fn root_mean_square(errors: &[f64]) -> f64 {
        (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
    }

    #[test]
    fn a_steady_climb_is_found_whatever_the_direction_and_the_stops() {
        let mut position: Vec<f64> = (0..2000).rev().map(|i| 0.7 * f64::from(i)).collect();
        position.extend(vec![0.0; 5000]);
        let altitude: Vec<f64> = position.iter().map(|s| 500.0 - 0.004 * s).collect();
        for slope in gradient_permille(&position, &altitude) {
            assert!((slope + 4.0).abs() < 1e-9, "{slope}");
        }
    }

    #[test]
    fn whole_metres_of_altitude_leave_an_error_of_about_one_permille() {
        let position: Vec<f64> = (0..20_000).map(|i| 2.0 * f64::from(i)).collect();
        let truth = |s: f64| 12.0 * (s / 900.0).sin();
        let altitude = |s: f64| (400.0 - 0.9 * 12.0 * (s / 900.0).cos()).round();
        let altitude: Vec<f64> = position.iter().map(|&s| altitude(s)).collect();
        let errors: Vec<f64> = gradient_permille(&position, &altitude)
            .iter()
            .zip(&position)
            .map(|(slope, &s)| slope - truth(s))
            .collect();
        let error = root_mean_square(&errors);
        assert!((0.3..1.2).contains(&error), "{error}");
    }

    #[test]
    fn missing_altitudes_are_bridged_and_a_short_way_says_nothing() {
        let position: Vec<f64> = (0..400).map(f64::from).collect();
        let mut altitude: Vec<f64> = position.iter().map(|s| 0.01 * s).collect();
        altitude[150..200].fill(f64::NAN);
        let slopes = gradient_permille(&position, &altitude);
        assert!((slopes[140] - 10.0).abs() < 1e-9);
        assert!((slopes[175] - 10.0).abs() < 1e-9);
        let short = gradient_permille(&position[..60], &altitude[..60]);
        assert!(short.iter().all(|slope| slope.is_nan()));
    }

    #[test]
    fn wild_positions_do_not_hurt() {
        let position = [0.0, f64::NAN, 1e300, -1e300, 5.0];
        assert!(gradient_permille(&position, &[1.0; 5]).iter().all(|slope| slope.is_nan()));
    }
}
