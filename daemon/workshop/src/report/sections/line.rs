//! The line as a picture: what is declared, what was found, and where the residual lives.

use super::Section;
use crate::report::Subject;
use crate::report::html::legend;
use crate::report::plots::{PlotError, figure, line, wide_and_narrow};

/// The section; none where no line is declared and no position known.
///
/// # Errors
///
/// When the plot cannot be drawn.
pub fn section(subject: &Subject) -> Result<Option<Section>, PlotError> {
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
    Ok(Some(Section { id: "line", title: "Along the line", body }))
}
