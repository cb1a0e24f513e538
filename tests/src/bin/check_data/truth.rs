//! Contents of the truth file of a practice dataset.

use std::path::Path;

use serde_json::Value;

/// The undeclared effects of a dataset, and the reduction of the error by a model that knows them.
pub struct Truth {
    /// The right verdict.
    pub verdict: String,
    /// The effects, in the words of an answer.
    pub effects: Vec<Value>,
    /// Reduction in m/s of the error on the holdout runs by a fit of the true effect.
    pub attainable_mps: f64,
    /// Files of the runs that are fitted.
    pub fit_files: Vec<String>,
}

impl Truth {
    /// Reads `practice-truth/NAME.json` under a folder.
    ///
    /// # Errors
    ///
    /// In words, when the file cannot be read or lacks an entry.
    pub fn read(folder: &Path, name: &str) -> Result<Truth, String> {
        let path = folder.join(format!("practice-truth/{name}.json"));
        let text = std::fs::read_to_string(&path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let truth: Value = serde_json::from_str(&text).map_err(|error| error.to_string())?;
        let lacks = |what: &str| format!("{} lacks {what}", path.display());
        let errors = &truth["oracle"]["metrics"]["full_run"];
        let error = |key: &str| errors[key].as_f64();
        let list = |key: &str| truth[key].as_array().cloned().ok_or_else(|| lacks(key));
        // Where nothing acts there is nothing to know.
        let attainable_mps = match (error("refit_abc"), error("oracle_fit")) {
            (Some(refit), Some(oracle)) => refit - oracle,
            _ => 0.0,
        };
        let is_fitted = |run: &&Value| run["role"] == "fit";
        let file = |run: &Value| run["file"].as_str().map(str::to_owned);
        Ok(Truth {
            verdict: truth["verdict"].as_str().ok_or_else(|| lacks("verdict"))?.into(),
            effects: list("effects")?,
            attainable_mps,
            fit_files: list("runs")?.iter().filter(is_fitted).filter_map(file).collect(),
        })
    }

    /// Returns the kinds of its effects.
    pub fn kinds(&self) -> Vec<&str> {
        self.effects.iter().filter_map(|effect| effect["kind"].as_str()).collect()
    }

    /// Returns the windows of time of an effect in the fitted runs: run, start and end in s.
    pub fn windows<'a>(&self, effect: &'a Value) -> Vec<(&'a str, f64, f64)> {
        let list = effect["where"]["windows"].as_array().into_iter().flatten();
        list.filter_map(|window| {
            let end = |key: &str| window[key].as_f64();
            Some((window["run"].as_str()?, end("t_start_s")?, end("t_end_s")?))
        })
        .filter(|(run, ..)| self.fit_files.iter().any(|file| file == run))
        .collect()
    }

    /// Intersection over union of the windows of two effects, of which the first has some.
    pub fn window_iou(&self, effect: &Value, found: &Value) -> Option<f64> {
        let (one, other) = (self.windows(effect), self.windows(found));
        let both: f64 = one
            .iter()
            .flat_map(|a| other.iter().filter(|b| a.0 == b.0).map(|b| (*a, *b)))
            .map(|(a, b)| (a.2.min(b.2) - a.1.max(b.1)).max(0.0))
            .sum();
        (!one.is_empty()).then(|| {
            let seconds: f64 = one.iter().chain(&other).map(|(_, from, to)| to - from).sum();
            both / (seconds - both)
        })
    }
}
