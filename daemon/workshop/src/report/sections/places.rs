//! Where the effects act, and how surely that is known.

use dynocar_analysis::explain::report::parameters::{PlaceRow, PlaceRuns};
use dynocar_analysis::explain::report::words::joined;

use crate::report::Subject;
use crate::report::html::Column::{Numbers, Words};
use crate::report::html::{self, TableColumn, escape, estimate};

/// A run counts as surely in or out beyond this probability.
const SURE: f64 = 0.99;
/// Runs that are named one by one at most.
const NAMED_MAX: usize = 8;

/// The table with its notes; empty where no place was estimated.
pub fn table(subject: &Subject) -> String {
    let places = &subject.data.places;
    if places.is_empty() {
        return String::new();
    }
    let mut html = String::from("<h3>Where, and how surely</h3>\n");
    if !places.ends.is_empty() {
        let columns: [TableColumn<PlaceRow>; 3] = [
            ("Place", Words, &|row| format!("{}: {}", escape(&row.group), escape(&row.end))),
            ("Unit", Words, &|row| row.unit.into()),
            ("Found", Numbers, &|row| estimate(&row.at)),
        ];
        html += &html::table("Ends of places with 95 % intervals", &columns, &places.ends);
    }
    for runs in &places.runs {
        html += &format!("<p class=\"note\">{}</p>\n", sentence(runs));
    }
    html + "<p class=\"note\">An end can lie wherever the data speak neither for nor against it, as \
            where no train braked; it is put in the middle of that.</p>\n"
}

fn sentence(place: &PlaceRuns) -> String {
    let listed = |runs: Vec<String>| {
        let more = runs.len().saturating_sub(NAMED_MAX);
        let mut named: Vec<String> = runs.into_iter().take(NAMED_MAX).collect();
        if more > 0 {
            named.push(format!("{more} more"));
        }
        escape(&joined(&named))
    };
    let with = |wanted: &dyn Fn(f64) -> bool| -> Vec<String> {
        let runs = place.runs.iter().filter(|(_, known)| wanted(*known));
        runs.map(|(run, _)| run.clone()).collect()
    };
    let open: Vec<String> = place
        .runs
        .iter()
        .filter(|(_, known)| (1.0 - SURE..=SURE).contains(known))
        .map(|(run, known)| format!("{run} ({:.0} %)", 100.0 * known))
        .collect();
    let groups = [
        ("acts for sure in", with(&|known| known > SURE)),
        ("for sure not in", with(&|known| known < 1.0 - SURE)),
        ("perhaps in", open),
    ];
    let parts: Vec<String> = groups
        .into_iter()
        .filter(|(_, runs)| !runs.is_empty())
        .map(|(words, runs)| format!("{words} {}", listed(runs)))
        .collect();
    let group = escape(&place.group);
    format!("Among the fit runs, {group} {} (more than 99 % counts as sure).", parts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_distinguished_by_how_surely_the_effect_acts_in_them() {
        let runs = [("1.csv", 1.0), ("2.csv", 0.0), ("3.csv", 0.6), ("<4>.csv", 0.999)];
        let runs = runs.map(|(run, known)| (run.to_string(), known)).to_vec();
        assert_eq!(
            sentence(&PlaceRuns { group: "low adhesion".into(), runs }),
            "Among the fit runs, low adhesion acts for sure in 1.csv and &lt;4&gt;.csv; \
             for sure not in 2.csv; perhaps in 3.csv (60 %) (more than 99 % counts as sure)."
        );
    }
}
