//! Contents of a state file: the train, wheel set and model, and the estimates.

use std::path::Path;

use dynocar_core::pipeline::{KeptEstimate, UseBefore};
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::Parameter;
use serde::{Deserialize, Serialize};

use super::file::checksum;
use super::{StateError, StateProblem};
use crate::config::TrainConfig;
use crate::stamp::{SinceBoot, Stamp};

/// Key of an estimate: another train, other wheels or another model is another key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelKey {
    /// The train's number on the channels.
    pub train: u64,
    /// The wheel set by the configuration; empty when it names none.
    pub wheel_set: String,
    /// Hash that identifies the model of train and line.
    pub model: u64,
}

impl ModelKey {
    /// Returns the key of a configured train.
    pub fn from_train(train: &TrainConfig) -> Self {
        ModelKey {
            train: train.id.0,
            wheel_set: train.wheel_set.clone(),
            model: train.model_hash.0,
        }
    }
}

/// Hash over an estimator's kind and settings.
pub fn settings_hash(settings: &EstimatorSettings) -> u64 {
    checksum(format!("{settings:?}").as_bytes())
}

/// A pipeline's estimate with the time at which it was valid.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredEstimate {
    /// The train.
    pub train: u64,
    /// The pipeline's name.
    pub pipeline: String,
    /// See [`settings_hash`].
    pub settings: u64,
    /// When the estimate was last validated.
    pub estimated: Stamp,
    /// The estimate.
    pub estimate: KeptEstimate,
}

/// The content of a state file.
#[derive(Clone, Debug, PartialEq)]
pub struct StateContent {
    /// Key of the estimates.
    pub key: ModelKey,
    /// One for each pipeline that ever was valid.
    pub estimates: Vec<StoredEstimate>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawState {
    version: String,
    train: u64,
    wheel_set: String,
    model: String,
    #[serde(default)]
    estimates: Vec<RawEstimate>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEstimate {
    pipeline: String,
    settings: String,
    estimated_unix_s: f64,
    parameters: Vec<String>,
    values: Vec<f64>,
    covariance: Vec<f64>,
    /// Of a release that did not keep how it was used, nothing is known.
    #[serde(default)]
    sample_time_ns: i64,
    #[serde(default)]
    usable_quantities: u32,
    speeds_mps: Option<(f64, f64)>,
    /// Absent where the system does not tell its starts apart.
    estimated_since_boot: Option<SinceBoot>,
}

impl StateContent {
    /// Returns the content as text.
    ///
    /// # Errors
    ///
    /// When a value has no textual form.
    pub fn to_text(&self) -> Result<String, toml::ser::Error> {
        let estimates = self.estimates.iter().map(|it| RawEstimate {
            pipeline: it.pipeline.clone(),
            settings: format!("{:016x}", it.settings),
            estimated_unix_s: it.estimated.unix_s,
            parameters: it.estimate.parameters().iter().map(Parameter::to_string).collect(),
            values: it.estimate.values().to_vec(),
            covariance: it.estimate.covariance().to_vec(),
            sample_time_ns: it.estimate.use_before.sample_time_ns,
            usable_quantities: it.estimate.use_before.usable_quantities,
            speeds_mps: it.estimate.use_before.speeds_mps,
            estimated_since_boot: it.estimated.since_boot.clone(),
        });
        toml::to_string(&RawState {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            train: self.key.train,
            wheel_set: self.key.wheel_set.clone(),
            model: format!("{:016x}", self.key.model),
            estimates: estimates.collect(),
        })
    }

    /// Reads the text that [`StateContent::to_text`] wrote; `path` is the file it came from.
    ///
    /// # Errors
    ///
    /// When a key or value is not the expected value.
    pub fn from_text(path: &Path, text: &str) -> Result<Self, StateError> {
        let malformed = |message: String| StateProblem::Malformed(message).at(path);
        let raw: RawState =
            toml::from_str(text).map_err(|error| malformed(error.message().to_owned()))?;
        let hash = |text: &str| {
            u64::from_str_radix(text, 16)
                .map_err(|_| malformed(format!("{text:?}: expected a hash in hexadecimal digits")))
        };
        let ours = env!("CARGO_PKG_VERSION");
        if raw.version != ours {
            let (what, ours) = ("release", ours.to_owned());
            return Err(StateProblem::Foreign { what, saved: raw.version, ours }.at(path));
        }
        let key = ModelKey { train: raw.train, wheel_set: raw.wheel_set, model: hash(&raw.model)? };
        let stored = |it: RawEstimate| {
            let parameters: Option<Vec<_>> =
                it.parameters.iter().map(|name| Parameter::from_name(name)).collect();
            let mut estimate =
                KeptEstimate::new(&parameters.unwrap_or_default(), &it.values, &it.covariance)
                    .map_err(|reason| malformed(format!("estimates.{}: {reason}", it.pipeline)))?;
            estimate.use_before = UseBefore {
                sample_time_ns: it.sample_time_ns,
                usable_quantities: it.usable_quantities,
                speeds_mps: it.speeds_mps.filter(|it| (it.0 + it.1).is_finite()),
                elapsed_s: 0.0,
            };
            let since_boot = it.estimated_since_boot;
            if !(it.estimated_unix_s.is_finite()
                && since_boot.as_ref().is_none_or(|it| it.elapsed_s.is_finite()))
            {
                return Err(malformed(format!("estimates.{}: no finite time", it.pipeline)));
            }
            Ok(StoredEstimate {
                train: key.train,
                settings: hash(&it.settings)?,
                pipeline: it.pipeline,
                estimated: Stamp { unix_s: it.estimated_unix_s, since_boot },
                estimate,
            })
        };
        let estimates = raw.estimates.into_iter().map(stored).collect::<Result<_, _>>()?;
        Ok(StateContent { key, estimates })
    }

    /// Refuses the content unless its key is the configuration's.
    ///
    /// # Errors
    ///
    /// Names the part that differs.
    pub fn require_key(&self, path: &Path, ours: &ModelKey) -> Result<(), StateError> {
        let theirs = &self.key;
        let parts = [
            ("train", theirs.train.to_string(), ours.train.to_string()),
            ("wheel set", format!("{:?}", theirs.wheel_set), format!("{:?}", ours.wheel_set)),
            ("model", format!("{:016x}", theirs.model), format!("{:016x}", ours.model)),
        ];
        match parts.into_iter().find(|(_, saved, ours)| saved != ours) {
            None => Ok(()),
            Some((what, saved, ours)) => Err(StateProblem::Foreign { what, saved, ours }.at(path)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn content() -> StateContent {
        let estimate = KeptEstimate::new(
            &[Parameter::DavisA, Parameter::DavisC],
            &[1.0 / 3.0, 1.234_567_890_123_456_7e-4],
            &[0.04, -1e-5, 1e-8],
        );
        StateContent {
            key: ModelKey { train: 7, wheel_set: "new \"2026\"".into(), model: 0xdead_beef },
            estimates: vec![StoredEstimate {
                train: 7,
                pipeline: "v_mils".into(),
                settings: 42,
                estimated: Stamp {
                    unix_s: 1.75e9 + 0.125,
                    since_boot: Some(SinceBoot { boot_id: "a".into(), elapsed_s: 3.0 }),
                },
                estimate: estimate.unwrap(),
            }],
        }
    }

    #[test]
    fn text_leads_back_to_the_same_bits() {
        let text = content().to_text().unwrap();
        assert_eq!(StateContent::from_text(Path::new("x"), &text).unwrap(), content());
    }

    #[test]
    fn what_is_not_understood_is_named() {
        let text = content().to_text().unwrap();
        let cases = [
            ("parameters = [\"a\"", "parameters = [\"q\"", "estimates.v_mils: it has no known"),
            ("0.04", "-0.04", "not finite and positive definite"),
            ("0.04", "nan", "not finite and positive definite"),
            ("000000000000002a", "beef?", "\"beef?\": expected a hash"),
            ("wheel_set", "wheels", "unknown field `wheels`"),
        ];
        for (old, new, expected) in cases {
            assert!(text.contains(old), "{old} in\n{text}");
            let error = StateContent::from_text(Path::new("x"), &text.replace(old, new));
            let message = error.unwrap_err().to_string();
            assert!(message.contains(expected), "expected {expected:?} in {message}");
        }
    }

    #[test]
    fn another_train_wheel_set_model_or_release_is_foreign() {
        let key = content().key;
        let others = [
            ("train", ModelKey { train: 8, ..key.clone() }),
            ("wheel set", ModelKey { wheel_set: "worn".into(), ..key.clone() }),
            ("model", ModelKey { model: 1, ..key.clone() }),
        ];
        assert!(content().require_key(Path::new("x"), &key).is_ok());
        for (what, other) in others {
            let message = content().require_key(Path::new("x"), &other).unwrap_err().to_string();
            assert!(message.starts_with(&format!("x: foreign: its {what} is")), "{message}");
        }
        let ours = format!("version = \"{}\"", env!("CARGO_PKG_VERSION"));
        let text = content().to_text().unwrap().replace(&ours, "version = \"9.9.9\"");
        let message = StateContent::from_text(Path::new("x"), &text).unwrap_err().to_string();
        assert!(message.contains("its release is 9.9.9"), "{message}");
    }
}
