//! The rows that every braking table has.

use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_estimators::xie::{EStep, EmSettings};

use super::bound::{BoundAt, PriorKnowledge, bound, deviation, mean_relative_percent};
use super::braking::Braking;
use super::braking_score::{
    BrakingScore, LAG_S, LAG_STEPS, MIDDLE_STEPS, drawn_braking, ekf, em, known_law, presumed,
    score, smoother,
};
use super::row::{PaperRow, Seeds};

/// One of the papers' tables, and the measurement that belongs to it.
pub struct Table {
    /// Short name of the paper.
    pub paper: &'static str,
    /// Number of the table.
    pub table: &'static str,
    /// Name of the estimated coefficient, in words.
    pub name: &'static str,
    /// The braking.
    pub braking: Braking,
    /// Initial values that the paper tries; the runs take them in turn.
    pub initials: &'static [f64],
    /// The paper's mean relative error in %.
    pub published_percent: f64,
    /// The paper's mean relative error of its baseline in %.
    pub published_baseline_percent: f64,
}

/// Scores that stand side by side in a row.
struct Compared<'s> {
    /// Of the paper's method, where it is measured.
    em: Option<&'s BrakingScore>,
    /// Of the paper's baseline, where it is measured.
    ekf: Option<&'s BrakingScore>,
    /// Of our smoother.
    ours: &'s BrakingScore,
    /// Degrees of freedom of its normalised squared error.
    freedom: f64,
}

impl Table {
    /// Returns the initial value of a run.
    pub fn initial(&self, seed: u64) -> f64 {
        self.initials[seed as usize % self.initials.len()]
    }

    /// Returns a row without figures.
    pub fn row(&self, what: &str, unit: &'static str, seeds: Seeds) -> PaperRow {
        PaperRow::new(self.paper, self.table, format!("{}, {what}", self.name), unit, seeds)
    }

    /// Returns the rows that every table has: the present, 5 s back, and the baseline on its own.
    pub fn comparison(&self, seeds: Seeds) -> Vec<PaperRow> {
        let sought = self.braking.sought;
        let lags = [0, MIDDLE_STEPS];
        let em_by = |e_step| {
            score(&self.braking, seeds, lags, |seed| {
                let initial = Some(self.initial(seed));
                em(sought, EmSettings { initial, seed, e_step, ..EmSettings::default() })
            })
        };
        let [em_end, em_middle] = em_by(EStep::Particle);
        let [_, exact_middle] = em_by(EStep::Kalman);
        let [ekf] = score(&self.braking, seeds, [0], |seed| ekf(sought, self.initial(seed)));
        let [present] = score(&self.braking, seeds, [0], |_| smoother(sought, 0.0));
        let [back] = score(&self.braking, seeds, [LAG_STEPS], |_| smoother(sought, LAG_S));
        let knowledge = PriorKnowledge::Share(presumed(sought));
        let drawn = |lag_s, lag_steps| drawn_score(sought, lag_s, lag_steps, seeds);
        let freedom =
            |own: &BrakingScore, drawn: BrakingScore| own.nees_freedom_of_one_curve(&drawn);
        let (at_present, at_back) =
            (freedom(&present, drawn(0.0, 0)), freedom(&back, drawn(LAG_S, LAG_STEPS)));
        let mut rows = Vec::new();
        rows.extend(self.pair(
            "the present",
            Compared { em: Some(&em_end), ekf: Some(&ekf), ours: &present, freedom: at_present },
            &bound(&self.braking, knowledge, 0),
            seeds,
        ));
        let back = self.pair(
            "5 s back",
            Compared { em: Some(&em_middle), ekf: None, ours: &back, freedom: at_back },
            &bound(&self.braking, knowledge, LAG_STEPS),
            seeds,
        );
        rows.extend(back.into_iter().map(|row| row.noted("EM: middle of the window")));
        rows.push(PaperRow {
            paper_method: Some(exact_middle.relative_percent),
            ..self.row("EM with exact E-step, middle of the window", "%", seeds)
        });
        rows.push(PaperRow {
            published: Some(self.published_baseline_percent),
            baseline: Some(ekf.relative_percent),
            ..self.row("the present, the baseline's figure", "%", seeds)
        });
        rows
    }

    /// Returns the rows where the curve over speed is known but for its scale.
    pub fn known_law(&self, scale_std: f64, seeds: Seeds) -> Vec<PaperRow> {
        let sought = self.braking.sought;
        let [score] = score(&self.braking, seeds, [0], |_| known_law(sought));
        let bounds = bound(&self.braking, PriorKnowledge::Law(scale_std), 0);
        self.pair(
            "the present, the law known but for its scale",
            Compared { em: None, ekf: None, ours: &score, freedom: score.nees_freedom() },
            &bounds,
            seeds,
        )
    }

    /// Returns a row of mean relative errors and one of root mean square errors.
    fn pair(
        &self,
        what: &str,
        compared: Compared<'_>,
        bounds: &[BoundAt],
        seeds: Seeds,
    ) -> Vec<PaperRow> {
        let Compared { em, ekf, ours, freedom } = compared;
        let row = |what: &str, unit| ours.row(freedom, self.row(what, unit, seeds));
        vec![
            PaperRow {
                published: Some(self.published_percent),
                paper_method: em.map(|score| score.relative_percent),
                baseline: ekf.map(|score| score.relative_percent),
                ours: Some(ours.relative_percent),
                bound: Some(mean_relative_percent(bounds)),
                ..row(&format!("mean relative error, {what}"), "%")
            },
            PaperRow {
                paper_method: em.map(|score| score.rmse()),
                baseline: ekf.map(|score| score.rmse()),
                ours: Some(ours.rmse()),
                bound: Some(deviation(bounds)),
                ..row(&format!("root mean square error, {what}"), "1")
            },
        ]
    }
}

/// Returns our smoother over runs that each draw a coefficient from its own model.
pub fn drawn_score(
    sought: BrakingCoefficient,
    lag_s: f64,
    lag_steps: usize,
    seeds: Seeds,
) -> BrakingScore {
    let [score] = score(&drawn_braking(sought), seeds, [lag_steps], |_| smoother(sought, lag_s));
    score
}

/// Returns the rows in which the coefficient is drawn from the very model of the smoother, so that bound,
/// coverage and NEES apply without reservation.
pub fn drawn_rows(
    paper: &'static str,
    sought: BrakingCoefficient,
    name: &'static str,
    seeds: Seeds,
) -> Vec<PaperRow> {
    let braking = drawn_braking(sought);
    let knowledge = PriorKnowledge::Share(presumed(sought));
    let row = |(what, lag_s, lag_steps)| {
        let score = drawn_score(sought, lag_s, lag_steps, seeds);
        let quantity = format!("{name}, root mean square error, {what}");
        PaperRow {
            bound: Some(deviation(&bound(&braking, knowledge, lag_steps))),
            ..score.row(
                score.nees_freedom(),
                PaperRow::new(paper, "drawn coefficients", quantity, "1", seeds),
            )
        }
    };
    [("the present", 0.0, 0), ("5 s back", LAG_S, LAG_STEPS)].map(row).into()
}
