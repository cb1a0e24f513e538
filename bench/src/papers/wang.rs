//! Wang 2022: staged learning of resistance and mass, traction energy.
//!
//! - [`shuttle`], [`ride`]: the scenario, from line to samples
//! - [`bound`]: the Cramér–Rao bounds
//! - [`resistance_rows`], [`mass_rows`], [`energy_rows`]: the comparison

mod bound;
mod energy_rows;
mod mass_rows;
mod resistance_rows;
mod ride;
mod shuttle;

use super::row::{PaperRow, Seeds};

/// Returns every row of the paper over a number of seeded runs.
///
/// A row whose runs are whole crossings, or whose results hardly scatter, has 20 runs at most; each row states its
/// number.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = resistance_rows::rows(seeds);
    rows.extend(mass_rows::rows(seeds));
    rows.extend(energy_rows::rows(seeds));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row<'a>(rows: &'a [PaperRow], beginning: &str) -> &'a PaperRow {
        rows.iter().find(|row| row.quantity.starts_with(beginning)).expect(beginning)
    }

    #[test]
    fn every_figure_of_a_short_run_is_a_number_and_ours_beat_the_papers() {
        let rows = rows(Seeds::from_zero(6));
        for row in &rows {
            let figures =
                [row.paper_method, row.baseline, row.ours, row.bound, row.coverage, row.nees];
            assert!(figures.iter().flatten().all(|figure| figure.is_finite()), "{row:?}");
        }
        for beginning in
            ["basic resistance", "curve resistance", "tunnel resistance", "mass of 117.1 t after"]
        {
            let row = row(&rows, beginning);
            let (paper, ours) = (row.paper_method.unwrap(), row.ours.unwrap());
            let bound = row.bound.unwrap();
            assert!(ours < 0.5 * paper, "{row:?}");
            // Six runs scatter: the root mean square of six lies within a factor of two.
            assert!(ours < 2.0 * bound && ours > 0.4 * bound, "{row:?}");
        }
        let disturbed = [
            ("mass of 117.1 t after one leg, headwind", 0.6),
            ("mass of 117.1 t after one leg, gradient", 0.6),
        ];
        for (beginning, limit_percent) in disturbed {
            assert!(row(&rows, beginning).ours.unwrap() < limit_percent);
        }
        let bias = row(&rows, "bias of the mass");
        assert!(bias.paper_method.unwrap() < -2.0 && bias.ours.unwrap().abs() < 0.05, "{bias:?}");
        let settling = row(&rows, "12 % more mass");
        assert!(settling.ours.unwrap() < 30.0 && settling.paper_method.is_none(), "{settling:?}");
    }

    #[test]
    fn what_is_not_identifiable_shifts_the_mass_by_as_much() {
        let rows = mass_rows::rows(Seeds::from_zero(2));
        let gain = row(&rows, "mean error of the mass of 117.1 t with the traction table");
        assert!((gain.ours.unwrap() - 1.0).abs() < 0.1, "{gain:?}");
        let rotating = row(&rows, "mean error of the mass of 117.1 t with a rotating mass");
        assert!((rotating.ours.unwrap() - 8.0).abs() < 0.5, "{rotating:?}");
    }

    #[test]
    fn at_equal_running_time_the_assumed_mass_hardly_changes_the_energy() {
        let rows = energy_rows::rows(Seeds::from_zero(1));
        for control in ["closed-loop", "feed-forward"] {
            let saving = row(&rows, &format!("traction energy saved, {control}"));
            assert!(saving.ours.unwrap().abs() < 1.0, "{saving:?}");
        }
        let feed_forward = row(&rows, "traction energy saved, feed-forward");
        assert!(feed_forward.paper_method.unwrap() > 2.0, "{feed_forward:?}");
        assert!(row(&rows, "later arrival, feed-forward").paper_method.unwrap() > 1.0);
        let two_trains = row(&rows, "traction energy saved, two trains");
        assert!((two_trains.ours.unwrap() - 6.06).abs() < 0.5, "{two_trains:?}");
    }
}
