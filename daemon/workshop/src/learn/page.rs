//! The history of the models of all trains as one page: the origin of each model, decisions, maintenance events, open
//! questions, and the daily error of a train's models, as the daemon's trials measured it.

use std::collections::BTreeSet;
use std::time::SystemTime;

use dynocar::models::history::{ModelHistory, State};
use dynocar::models::origin::HeldOutError;
use dynocar::models::records::{Numbered, in_force_after};
use dynocar::models::{Action, Decision, MaintenanceEvent, ModelHash, Origin, Stored, UtcSecond};
use dynocar::shadow::record::TrialRecord;
use dynocar_model::words::kind_name;
use dynocar_shared::TrainId;

use super::LearnError;
use super::learner::Learner;
use super::memory::OpenQuestion;
use crate::report::html::ColumnAlignment::{Numbers, Words};
use crate::report::html::{self, TableColumn, chance, escape, legend, marked_table, table};
use crate::report::page::document;
use crate::report::plots::series::{self, DailyErrors};
use crate::report::plots::{PlotError, figure, wide_and_narrow};
use crate::report::provenance::Provenance;

/// Returns the page on the contents of a learner's store.
///
/// # Errors
///
/// When the store cannot be read, or the plot cannot be drawn.
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
        let (history, events) = (ModelHistory::from_train(&models)?, models.events()?);
        let open: Vec<&OpenQuestion> = learner.memory().open_of(train).collect();
        let errors = errors_by_day(&history, &TrialRecord::read(models.folder()))
            .map_err(|error| LearnError::Report(error.to_string()))?;
        let page = TrainPage { history: &history, events: &events, open: &open, errors };
        main += &page.html(train);
    }
    Ok(document("History of the models", &header, &main, &made))
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Contents of one train's sections.
struct TrainPage<'p> {
    history: &'p ModelHistory,
    events: &'p [Numbered<MaintenanceEvent>],
    open: &'p [&'p OpenQuestion],
    /// The plot of the error by day, as HTML; empty without a measured error.
    errors: String,
}

impl TrainPage<'_> {
    fn html(self, train: TrainId) -> String {
        let mut html = String::new();
        let mut section = |name: &str, title: &str, body: String| {
            html += &html::section(&format!("train-{train}-{name}"), title, &body);
        };
        section("models", &format!("Train {train}: models"), models(self.history));
        if !self.errors.is_empty() {
            section("errors", "Error by day", self.errors);
        }
        section("decisions", "Decisions", decisions(&self.history.decisions));
        section("events", "Maintenance events", of_events(self.events));
        section("open", "Open questions", of_questions(self.open));
        html
    }
}

fn models(history: &ModelHistory) -> String {
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
    let is_root = |stored: &Stored| {
        let parent = stored.origin.parent;
        !history.models.iter().any(|(other, _)| Some(other.hash) == parent)
    };
    let mut rows = Vec::new();
    for (stored, state) in history.models.iter().filter(|(stored, _)| is_root(stored)) {
        push_tree(&mut rows, history, (stored, *state), 0);
    }
    let indent = |depth: usize| match depth {
        0 => String::new(),
        depth => "\u{2003}".repeat(depth - 1) + "└\u{a0}",
    };
    let adds = |it: &Origin| {
        format!("<span title=\"{}\">{}</span>", escape(&it.statement), escape(&it.adds()))
    };
    let error = |it: &Stored, pick: fn(&HeldOutError) -> f64| {
        it.origin.error.as_ref().map_or("–".into(), |error| format!("{:.3}", pick(error)))
    };
    let columns: [TableColumn<ModelRow>; 6] = [
        ("Model", Words, &|it| format!("{}<code>{}</code>", indent(it.2), it.0.hash)),
        ("Made, UTC", Words, &|it| minute(it.0.origin.made)),
        ("State", Words, &|it| it.1.name().into()),
        ("Adds", Words, &|it| adds(&it.0.origin)),
        ("Before, m/s", Numbers, &|it| error(it.0, |error| error.before_mps)),
        ("After, m/s", Numbers, &|it| error(it.0, |error| error.after_mps)),
    ];
    let caption =
        "Each model below the one that it grew from; error of free prediction on runs held out";
    let table = marked_table(caption, &columns, &rows, |it| it.1 == State::InForce);
    format!("<p>{words}</p>\n{table}")
}

/// A model with its state, and how deep it stands below the one that all grew from.
type ModelRow<'h> = (&'h Stored, State, usize);

/// A model and those that grew from it, each deeper than its parent.
fn push_tree<'h>(
    rows: &mut Vec<ModelRow<'h>>,
    history: &'h ModelHistory,
    (stored, state): (&'h Stored, State),
    depth: usize,
) {
    rows.push((stored, state, depth));
    for (child, state) in &history.models {
        if child.origin.parent == Some(stored.hash) {
            push_tree(rows, history, (child, *state), depth + 1);
        }
    }
}

/// Returns a time to the minute.
fn minute(moment: UtcSecond) -> String {
    moment.to_string()[..16].replace('T', " ")
}

fn model(hash: Option<ModelHash>) -> String {
    hash.map_or("as configured".into(), |hash| format!("<code>{hash}</code>"))
}

fn decisions(decisions: &[Numbered<Decision>]) -> String {
    if decisions.is_empty() {
        return "<p>Nothing was decided: what the configuration declares is in force.</p>\n".into();
    }
    let columns: [TableColumn<Numbered<Decision>>; 6] = [
        ("At, UTC", Words, &|(_, it)| minute(it.at)),
        ("Decision", Words, &|(_, it)| it.action.name().replace('_', " ")),
        ("Model", Words, &|(_, it)| model(it.model)),
        ("In force before", Words, &|(_, it)| model(it.from)),
        ("By", Words, &|(_, it)| escape(&it.by)),
        ("Reason", Words, &|(_, it)| escape(&it.reason)),
    ];
    table("Who decided what", &columns, decisions)
}

fn of_events(events: &[Numbered<MaintenanceEvent>]) -> String {
    if events.is_empty() {
        return "<p>None was found.</p>\n".into();
    }
    let columns: [TableColumn<Numbered<MaintenanceEvent>>; 4] = [
        ("Recorded, UTC", Words, &|(_, it)| it.acted.map_or("–".into(), |[at, _]| minute(at))),
        ("Kind", Words, &|(_, it)| escape(kind_name(&it.kind))),
        ("What", Words, &|(_, it)| escape(&it.sentence)),
        ("Chance where nothing acts", Numbers, &|(_, it)| chance(it.p_value, 1)),
    ];
    table(
        "What acted in certain runs, and is no property of the train or the line",
        &columns,
        events,
    )
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
        html += &format!(
            "<li>{} (model <code>{}</code>, {}).{settle}</li>\n",
            escape(it.statement.trim_end_matches('.')),
            it.model,
            it.at
        );
    }
    html + "</ul>\n"
}

const DAY_S: u64 = 86_400;

/// Returns the plot, as HTML; empty where nothing was measured.
///
/// # Errors
///
/// When it cannot be drawn.
fn errors_by_day(history: &ModelHistory, trials: &TrialRecord) -> Result<String, PlotError> {
    let measured = trials.models.iter().flat_map(|tried| tried.ledger.days.keys().copied());
    let numbers: BTreeSet<i64> = measured.collect();
    let Some(&first) = numbers.first() else { return Ok(String::new()) };
    let declared = history.models.iter().find(|(stored, _)| stored.origin.parent.is_none());
    let declared = declared.map(|(stored, _)| stored.hash);
    let error_mps = |model: Option<ModelHash>, number: i64| {
        trials.of(model?)?.ledger.days.get(&number)?.rmse_mps()
    };
    let days: Vec<DailyErrors> = numbers
        .iter()
        .map(|&number| DailyErrors {
            day: (number - first) as f64,
            declared_mps: error_mps(declared, number),
            in_force_mps: error_mps(in_force_on(history, number).or(declared), number),
        })
        .collect();
    let is_change = |action: Action| action != Action::Rejected;
    let last = numbers.last().map_or(first, |last| last + 1);
    let changes: Vec<f64> = history
        .decisions
        .iter()
        .filter(|(_, it)| is_change(it.action))
        .map(|(_, it)| it.at.unix_s as f64 / DAY_S as f64 - first as f64)
        .filter(|at| (-1.0..=(last - first) as f64).contains(at))
        .collect();
    let name = UtcSecond { unix_s: first as u64 * DAY_S }.day();
    let plots = wide_and_narrow(|width| series::days(&days, &changes, &name, width))?;
    let key = legend(&[("dot after", "in force"), ("ring before", "declared")]);
    let caption = "Open-loop error on the trips that were driven, by day; an upright line where \
                   another model came in force";
    Ok(figure("trace", caption, &key, &plots))
}

/// Returns the model that the decisions had put in force at the end of a day; `None` for the declaration.
fn in_force_on(history: &ModelHistory, number: i64) -> Option<ModelHash> {
    let end_s = (number + 1) as u64 * DAY_S;
    let before = history.decisions.iter().map(|(_, it)| it).filter(|it| it.at.unix_s < end_s);
    in_force_after(before).pop()
}
