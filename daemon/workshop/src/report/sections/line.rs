//! The line as a picture: what is declared, what was found, and where the residual lives.

use super::{Section, legend};
use crate::report::plots::speeds::Width;
use crate::report::plots::{figure, line};
use crate::report::{ReportError, Subject};

/// The section; none where no line is declared and no position known.
///
/// # Errors
///
/// When the plot cannot be drawn.
pub fn section(subject: &Subject) -> Result<Option<Section>, ReportError> {
    let (track, found) = (subject.dataset.track.as_deref(), &subject.data.line);
    let has_effect = subject.has_effect();
    let draw = |width| {
        line::draw(track, found, has_effect, width)
            .map_err(|source| ReportError::Plot { plot: "the line".into(), source })
    };
    let (Some(wide), Some(narrow)) = (draw(Width::Wide)?, draw(Width::Narrow)?) else {
        return Ok(None);
    };
    let mut entries = Vec::new();
    if !found.residual.is_empty() {
        let before = if has_effect { "before" } else { "declared model, a, b, c refitted" };
        entries.push(("ring before", before));
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
