//! The history of all trains' models as one page: what grew from what, what was decided, what happened in
//! certain runs, what is open.

use std::fmt::Write as _;
use std::time::SystemTime;

use dynocar_shared::TrainId;

use super::error::LearnError;
use super::errors_by_day;
use super::learner::Learner;
use super::memory::OpenQuestion;
use crate::report::document::document;
use crate::report::html::{Column, Table, escape};
use crate::report::provenance::Provenance;
use dynocar::models::history::{History, State};
use dynocar::models::numbered::Numbered;
use dynocar::models::{Decision, MaintenanceEvent, ModelHash, Moment, Stored};
use dynocar::shadow::record::Trials;

/// The page on what a learner's store holds.
///
/// # Errors
///
/// When the store cannot be read, or the plot not be drawn.
pub fn html(learner: &Learner, now: SystemTime) -> Result<String, LearnError> {
    let settings = learner.settings();
    let made = Provenance::of_files(Vec::new(), settings.command.clone(), now);
    let store = settings.store.directory().display().to_string();
    let trains: Vec<TrainId> = settings.trains.iter().map(|it| it.0).collect();
    let header = format!(
        "<p class=\"kicker\">Dynocar · what was learned</p>\n<h1>History of the models</h1>\n\
         <p class=\"facts\">{} · store {} · <span>{}</span></p>\n",
        counted(trains.len(), "train"),
        escape(&store),
        made.day
    );
    let mut main = String::new();
    for train in trains {
        let models = settings.store.train(train);
        let (history, events) = (History::of(&models)?, models.events()?);
        let open: Vec<&OpenQuestion> = learner.memory().open_of(train).collect();
        let errors = errors_by_day::html(&history, &Trials::read(models.folder()))
            .map_err(|error| LearnError::Report(error.to_string()))?;
        main += &of_train(train, &history, (&events, &open, errors));
    }
    Ok(document("History of the models", &header, &main, &made))
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn of_train(
    train: TrainId,
    history: &History,
    (events, open, errors): (&[Numbered<MaintenanceEvent>], &[&OpenQuestion], String),
) -> String {
    let mut html = String::new();
    let mut section = |name: &str, title: &str, body: String| {
        let id = format!("train-{train}-{name}");
        // Writing to a string cannot fail.
        let _ = write!(
            html,
            "<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n\
             <h2 id=\"{id}-title\">{title}</h2>\n{body}</section>\n"
        );
    };
    section("models", &format!("Train {train}: models"), models(history));
    if !errors.is_empty() {
        section("errors", "Error by day", errors);
    }
    section("decisions", "Decisions", decisions(&history.decisions));
    section("events", "Maintenance events", of_events(events));
    section("open", "Open questions", of_questions(open));
    html
}

fn models(history: &History) -> String {
    let [now, candidates] = [State::InForce, State::Candidate]
        .map(|wanted| history.models.iter().filter(|(_, state)| *state == wanted).count());
    let words = match (now, candidates) {
        (0, _) => "No model is in the store yet.".into(),
        (_, 0) => "No candidate waits for a decision.".into(),
        (_, count) => format!(
            "{} for a decision: <code>dynocar models adopt</code> or <code>reject</code>.",
            if count == 1 {
                "One candidate waits".into()
            } else {
                format!("{count} candidates wait")
            }
        ),
    };
    let mut table = Table::new(
        "Each model below the one that it grew from; error of free prediction on runs held out",
        &[
            ("Model", Column::Words),
            ("Made, UTC", Column::Words),
            ("State", Column::Words),
            ("Adds", Column::Words),
            ("Before, m/s", Column::Numbers),
            ("After, m/s", Column::Numbers),
        ],
    );
    let is_root = |stored: &Stored| {
        let parent = stored.origin.parent;
        !history.models.iter().any(|(other, _)| Some(other.hash) == parent)
    };
    for (stored, state) in history.models.iter().filter(|(stored, _)| is_root(stored)) {
        push_tree(&mut table, history, (stored, *state), 0);
    }
    format!("<p>{words}</p>\n{}", table.html())
}

/// A model and those that grew from it, each deeper than its parent.
fn push_tree(
    table: &mut Table,
    history: &History,
    (stored, state): (&Stored, State),
    depth: usize,
) {
    let origin = &stored.origin;
    let indent =
        if depth == 0 { String::new() } else { "\u{2003}".repeat(depth - 1) + "└\u{a0}" };
    let error = |pick: fn(&dynocar::models::origin::HeldOutError) -> f64| {
        origin.error.as_ref().map_or("–".into(), |error| format!("{:.3}", pick(error)))
    };
    let cells = vec![
        format!("{indent}<code>{}</code>", stored.hash),
        minute(origin.made),
        state.words().into(),
        format!("<span title=\"{}\">{}</span>", escape(&origin.statement), escape(&origin.adds())),
        error(|it| it.before_mps),
        error(|it| it.after_mps),
    ];
    if state == State::InForce {
        table.push_marked(cells)
    } else {
        table.push(cells)
    }
    for (child, state) in &history.models {
        if child.origin.parent == Some(stored.hash) {
            push_tree(table, history, (child, *state), depth + 1);
        }
    }
}

/// A time to the minute.
fn minute(moment: Moment) -> String {
    moment.to_string()[..16].replace('T', " ")
}

fn model(hash: Option<ModelHash>) -> String {
    hash.map_or("as configured".into(), |hash| format!("<code>{hash}</code>"))
}

fn decisions(decisions: &[Numbered<Decision>]) -> String {
    if decisions.is_empty() {
        return "<p>Nothing was decided: what the configuration declares is in force.</p>\n".into();
    }
    let mut table = Table::new(
        "Who decided what",
        &[
            ("At, UTC", Column::Words),
            ("Decision", Column::Words),
            ("Model", Column::Words),
            ("In force before", Column::Words),
            ("By", Column::Words),
            ("Reason", Column::Words),
        ],
    );
    for (_, it) in decisions {
        table.push(vec![
            minute(it.at),
            it.action.name().replace('_', " "),
            model(it.model),
            model(it.from),
            escape(&it.by),
            escape(&it.reason),
        ]);
    }
    table.html()
}

fn of_events(events: &[Numbered<MaintenanceEvent>]) -> String {
    if events.is_empty() {
        return "<p>None was found.</p>\n".into();
    }
    let mut table = Table::new(
        "What acted in certain runs, and is no property of the train or the line",
        &[
            ("Recorded, UTC", Column::Words),
            ("Kind", Column::Words),
            ("What", Column::Words),
            ("Chance where nothing acts", Column::Numbers),
        ],
    );
    for (_, it) in events {
        let chance =
            if it.p_value < 1e-6 { "&lt; 10⁻⁶".into() } else { format!("{:.1e}", it.p_value) };
        table.push(vec![
            it.acted.map_or("–".into(), |[first, _]| minute(first)),
            escape(&it.kind.replace('_', " ")),
            escape(&it.sentence),
            chance,
        ]);
    }
    table.html()
}

fn of_questions(open: &[&OpenQuestion]) -> String {
    if open.is_empty() {
        return "<p>None.</p>\n".into();
    }
    let mut html = String::from("<ul>\n");
    for it in open {
        let settle = it.experiment.as_deref().map_or(String::new(), |experiment| {
            format!(" <strong>To settle it:</strong> {}", escape(experiment))
        });
        let _ = writeln!(
            html,
            "<li>{} (model <code>{}</code>, {}).{settle}</li>",
            escape(it.statement.trim_end_matches('.')),
            it.model,
            it.at
        );
    }
    html + "</ul>\n"
}
