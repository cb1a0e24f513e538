//! The report's plots as separate files.

use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::report::panels::Panel;

use super::Subject;
use super::plots::{Plot, PlotError, Width, as_file, line, panel, series, speeds};

/// Returns name and SVG of every plot of the report: the errors of the runs, the line with the findings along it, the
/// speeds of runs, the residual against covariates.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn images(
    dataset: &Dataset,
    explanation: &Explanation,
) -> Result<Vec<(String, String)>, PlotError> {
    let subject = &Subject::new(dataset, explanation);
    let (data, has_effect) = (&subject.data, subject.has_effect());
    let mut images = Vec::new();
    let mut keep = |name: String, plot: Plot| images.push((name, as_file(&plot.svg)));
    for role in [Role::Holdout, Role::Fit] {
        let own = subject.errors_of(role);
        if !own.is_empty() {
            keep(
                format!("errors_{}.svg", role.name()),
                series::errors_of_runs(&own, role, has_effect)?,
            );
        }
    }
    let track = dataset.track.as_deref();
    if let Some(plot) = line::draw(track, &data.line, has_effect, Width::Wide)? {
        keep("line.svg".into(), plot);
    }
    for trace in &data.traces {
        let name = format!("speed_run_{}.svg", subject.number(&trace.file));
        keep(name, speeds::draw(trace, Width::Wide, has_effect)?);
    }
    for shown in &data.panels {
        let run = shown.file.as_deref().map(|file| subject.number(file));
        keep(panel_name(shown, run), panel::draw(shown, has_effect)?);
    }
    Ok(images)
}

/// As `residual_by_outside_temperature.svg`.
fn panel_name(panel: &Panel, run: Option<usize>) -> String {
    let covariate = panel.covariate.title().to_lowercase().replace([' ', '-'], "_");
    let run = run.map_or(String::new(), |number| format!("_{number}"));
    format!("residual_by_{covariate}{run}.svg")
}

#[cfg(test)]
mod tests {
    use dynocar_analysis::explain::report::covariates::Covariate;

    use super::*;

    #[test]
    fn a_panel_is_named_by_its_covariate_and_its_run() {
        let panel =
            |covariate| Panel { covariate, file: None, bins: Vec::new(), acting: Vec::new() };
        let name = panel_name(&panel(Covariate::Temperature), None);
        assert_eq!(name, "residual_by_outside_temperature.svg");
        let name = panel_name(&panel(Covariate::TimeInRun(0)), Some(4));
        assert_eq!(name, "residual_by_time_in_the_run_4.svg");
    }
}
