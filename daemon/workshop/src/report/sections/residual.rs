//! The residual as a force: against covariates, and along the line.

use dynocar_analysis::explain::report::covariates::Covariate;

use super::{PageSection, Subject};
use crate::report::html::{escape, legend};
use crate::report::plots::{PlotError, figure, line, panel, wide_and_narrow};

/// Returns the section.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn section(subject: &Subject) -> Result<PageSection, PlotError> {
    let has_effect = subject.has_effect();
    let mut body = String::from(
        "<p>The resistance that the model lacks, in N per kN of weight (positive retards), on the \
         fit runs: in windows of about 20 s of motion, the slope of measured minus modelled speed. \
         Each point is the mean over at least four windows with ±1.96 standard errors (single \
         windows, without an error, in plots of one run). Where nothing is missing, points scatter \
         around zero.</p>\n",
    );
    let mut entries = vec![("ring before", subject.before())];
    if has_effect {
        entries.push(("dot after", "after"));
        entries.push(("area band", "what the effect accounts for, 95 %"));
    }
    if subject.data.panels.iter().any(|panel| !panel.acting.is_empty()) {
        entries.push(("area acting", "where the effect acts"));
    }
    body += &legend(&entries);
    body += "<div class=\"panels\">\n";
    for panel in &subject.data.panels {
        let title = match &panel.file {
            Some(file) => format!("Run {}, {file}, over time", subject.number(file)),
            None => panel.covariate.title().to_string(),
        };
        let note = match panel.covariate {
            Covariate::Direction => " <small>(+1: chainage grows)</small>",
            _ => "",
        };
        body += &figure(
            "",
            &format!("{}{note}", escape(&title)),
            "",
            &[panel::draw(
                panel,
                panel.file.as_deref().and_then(|it| subject.run(it)),
                has_effect,
            )?],
        );
    }
    body += "</div>\n";
    if subject.data.panels.is_empty() {
        body += "<p>The fit runs hold too little motion for a window.</p>\n";
    }
    Ok(PageSection { id: "residual", title: "The residual force", body })
}

/// Returns the section; none where no line is declared and no position known.
///
/// # Errors
///
/// When the plot cannot be drawn.
pub fn line(subject: &Subject) -> Result<Option<PageSection>, PlotError> {
    let (track, found) = (subject.dataset.track.as_deref(), &subject.data.line);
    let has_effect = subject.has_effect();
    let plots = wide_and_narrow(|width| line::draw(track, found, has_effect, width))?;
    let [Some(wide), Some(narrow)] = plots else { return Ok(None) };
    let mut entries = Vec::new();
    if !found.residual.is_empty() {
        entries.push(("ring before", subject.before()));
        entries.extend(has_effect.then_some(("dot after", "after")));
    }
    if !found.places.is_empty() {
        entries
            .push(("area acting", "where an effect was found; whiskers: 95 % interval of an end"));
    }
    if !found.gradient_error.is_empty() {
        entries.push(("area band", "95 % band"));
    }
    if track.is_some_and(|track| !track.tunnels().is_empty()) {
        entries.push(("area tunnel", "declared tunnel"));
    }
    let body = String::from(
        "<p>The declared line, and below it what the model lacks there: the missing resistance as a \
         mean by place over at least four windows of about 20 s, with ±1.96 standard errors, for \
         each direction of travel. A resistance of a place retards trains in both directions; a wrong \
         gradient has opposite signs in the two.</p>\n",
    );
    let caption = if track.is_some() { "The line" } else { "Along the line (not declared)" };
    let body = body + &figure("trace", caption, &legend(&entries), &[wide, narrow]);
    Ok(Some(PageSection { id: "line", title: "Along the line", body }))
}
