//! The page from top to bottom, with the head and security policy that the pages of survey and learner have, too; and its
//! plots as separate files.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::{EffectAnswer, Verdict};
use dynocar_analysis::explain::report::effect;
use dynocar_analysis::explain::report::panels::Panel;
use dynocar_core::plausibility::Severity;
use dynocar_model::words;
use sha2::{Digest, Sha256};

use super::html::{chance, escape, section};
use super::plots::{Plot, PlotError, Width, as_file, colour_rules, line, panel, series, speeds};
use super::provenance::Provenance;
use super::sections::{PageSection, Subject, errors, model, quality, residual};
use crate::run_facts::tonnes;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("plots.js");

/// Returns a whole page; title, header and main part are HTML.
///
/// Its security policy lets it load nothing, and run no script but its own.
pub fn document(title: &str, header: &str, main: &str, made: &Provenance) -> String {
    let (version, day, colours) = (made.version, &made.day, colour_rules());
    let hash = STANDARD.encode(Sha256::digest(SCRIPT));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta name=\"generator\" content=\"dynocar {version}\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
         style-src 'unsafe-inline'; script-src 'sha256-{hash}'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}\n{colours}</style>\n</head>\n<body>\n\
         <header>\n{header}</header>\n<main>\n{main}</main>\n\
         <footer><p>Made by Dynocar {version} on {day}. The page is complete in itself: it loads \
         nothing.</p></footer>\n<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// Returns the page.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn html(subject: &Subject, provenance: &Provenance) -> Result<String, PlotError> {
    let mut sections = vec![errors::section(subject)?];
    sections.extend(residual::line(subject)?);
    sections.extend([
        residual::section(subject)?,
        model::parameters(subject),
        model::candidates(subject),
        quality::section(subject),
        quality::reproduce(provenance),
    ]);
    let name = escape(&subject.dataset.name);
    let mut main = diagnostics(subject) + &verdict(subject) + &contents(&sections);
    for PageSection { id, title, body } in &sections {
        main += &section(id, title, body);
    }
    let title = format!("{name} – residual report");
    Ok(document(&title, &header(subject, &name, provenance), &main, provenance))
}

fn header(subject: &Subject, name: &str, provenance: &Provenance) -> String {
    let dataset = subject.dataset;
    let description = dataset
        .description
        .as_deref()
        .map_or(String::new(), |text| format!("<p class=\"description\">{}</p>\n", escape(text)));
    let count = |role| dataset.with_role(role).count();
    let train = match &dataset.train.name[..] {
        "" => String::new(),
        train => format!("{}, ", escape(train)),
    };
    let line = if dataset.track.is_some() { "line known" } else { "line not known" };
    format!(
        "<p class=\"kicker\">Dynocar · residual report</p>\n<h1>{name}</h1>\n\
         {description}<p class=\"facts\">{train}{} t, {:.0} m · {line} · {} fit and {} holdout \
         runs · <span>{}</span></p>\n",
        tonnes(dataset.train.mass_kg),
        dataset.train.length_m,
        count(Role::Fit),
        count(Role::Holdout),
        provenance.day
    )
}

/// Class and words of a verdict.
fn badge(verdict: Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::None => ("none", "Nothing undeclared"),
        Verdict::Effect => ("effect", "Effect found"),
        Verdict::Ambiguous => ("open", "Ambiguous"),
        Verdict::Unknown => ("open", "Unknown cause"),
        Verdict::InsufficientData => ("open", "Insufficient data"),
    }
}

/// Returns the diagnostics that may spoil the verdict, to stand above it; empty when all is well.
fn diagnostics(subject: &Subject) -> String {
    let diagnostics = &subject.explanation.answer.diagnostics;
    if diagnostics.is_empty() {
        return String::new();
    }
    let is_impossible = subject.explanation.answer.impossibilities().next().is_some();
    let (class, title) =
        if is_impossible { (" impossible", "These data cannot be true") } else { ("", "Notes") };
    let mut html = format!(
        "<section id=\"notes\" class=\"notes{class}\" aria-labelledby=\"notes-title\">\n\
         <h2 id=\"notes-title\">{title}</h2>\n<ul>\n"
    );
    for diagnostic in diagnostics {
        let class =
            if diagnostic.severity == Severity::Fundamental { " class=\"impossible\"" } else { "" };
        let _ = writeln!(html, "<li{class}>{}</li>", escape(&diagnostic.to_string()));
    }
    html + "</ul>\n</section>\n"
}

fn verdict(subject: &Subject) -> String {
    let answer = &subject.explanation.answer;
    let (class, words) = badge(answer.verdict);
    let mut html = format!(
        "<section id=\"verdict\" class=\"verdict {class}\" aria-labelledby=\"verdict-title\">\n\
         <h2 id=\"verdict-title\">Verdict: <span>{words}</span></h2>\n\
         <p class=\"sentence\">{}</p>\n",
        escape(&subject.data.sentence)
    );
    let to_do = |effect: &EffectAnswer| {
        let words = effect::to_do(effect)?.replace('`', "");
        Some(format!("<p class=\"experiment\"><strong>To do:</strong> {}.</p>\n", escape(&words)))
    };
    match &answer.effects[..] {
        several @ [_, _, ..] if answer.verdict == Verdict::Effect => {
            html += "<ol class=\"effects\">\n";
            for effect in several {
                let (words, to_do) = (escape(&effect::described(effect)), to_do(effect));
                let _ = writeln!(html, "<li><p>{words}</p>\n{}</li>", to_do.unwrap_or_default());
            }
            html += "</ol>\n";
        }
        others => {
            let mut paragraphs: Vec<String> = Vec::new();
            for paragraph in others.iter().filter_map(to_do) {
                if !paragraphs.contains(&paragraph) {
                    paragraphs.push(paragraph);
                }
            }
            html += &paragraphs.concat();
        }
    }
    for caveat in &answer.caveats {
        let _ = writeln!(html, "<p class=\"note\">{}</p>", escape(caveat));
    }
    if let Some(experiment) = &answer.experiment {
        let title = match answer.verdict {
            Verdict::Ambiguous => "What would separate them",
            _ => "What would settle it",
        };
        let _ = writeln!(
            html,
            "<p class=\"experiment\"><strong>{title}.</strong> {}</p>",
            escape(experiment)
        );
    }
    html += &figures(subject);
    if let Some(unscored) = &answer.unscored {
        let _ = writeln!(html, "<p class=\"note\">{}</p>", escape(unscored));
    }
    html + "</section>\n"
}

/// Returns the figures that matter, large.
fn figures(subject: &Subject) -> String {
    let Some((role, judged)) = subject.data.errors.judged() else { return String::new() };
    let runs = if role == Role::Holdout { "holdout runs" } else { "fit runs" };
    let interval = |bounds: Option<[f64; 2]>, shown: &dyn Fn(f64) -> String| match bounds {
        Some([low, high]) => format!("95 % interval {} to {}", shown(low), shown(high)),
        None => "no interval: one run only".into(),
    };
    let speed = |value: f64| format!("{value:.3}");
    let share = |value: f64| format!("{} %", words::percent(value, judged.reduction_interval_95));
    let of_side = |side: usize| judged.interval_95_mps.map(|both| both[side]);
    let mut list = vec![(
        format!("{} <small>m/s</small>", speed(judged.error_mps[0])),
        if subject.has_effect() { "error before" } else { "error of the declared model" },
        interval(of_side(0), &speed),
    )];
    if subject.has_effect() {
        let after = format!("{} <small>m/s</small>", speed(judged.error_mps[1]));
        list.push((after, "error after", interval(of_side(1), &speed)));
        list.push((
            share(judged.reduction),
            "of the error taken away",
            interval(judged.reduction_interval_95, &share),
        ));
        let p_value = subject.explanation.answer.effects.iter().map(|effect| effect.p_value);
        let worst = p_value.fold(0.0, f64::max);
        list.push((chance(worst, 2), effect::CHANCE, "for the whole search".into()));
    }
    let mut html = String::from("<dl class=\"figures\">\n");
    for (value, what, more) in list {
        let what = if what.starts_with("error") {
            format!("{what}, {runs}{}", judged.predicted())
        } else {
            what.into()
        };
        let _ = writeln!(
            html,
            "<div><dt>{what}</dt><dd><b>{value}</b><span class=\"interval\">{more}</span></dd></div>"
        );
    }
    html + "</dl>\n"
}

fn contents(sections: &[PageSection]) -> String {
    let mut html = String::from("<nav aria-label=\"Contents\"><ol>\n");
    for section in sections {
        let _ = writeln!(html, "<li><a href=\"#{}\">{}</a></li>", section.id, section.title);
    }
    html + "</ol></nav>\n"
}

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
        keep(name, speeds::draw(trace, subject.run(&trace.file), Width::Wide, has_effect)?);
    }
    for shown in &data.panels {
        let number = shown.file.as_deref().map(|file| subject.number(file));
        let run = shown.file.as_deref().and_then(|file| subject.run(file));
        keep(panel_name(shown, number), panel::draw(shown, run, has_effect)?);
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
