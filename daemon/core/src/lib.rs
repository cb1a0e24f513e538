//! The estimators that learn a train while it drives, without side effects.
//!
//! They stand on the declared model of `dynocar_model`, and know no channel, clock, file, thread or logger: times and
//! seeds come in as arguments. The daemon runs these pipelines online, `dynocar identify` offline; both get the same
//! bits from the same samples. The library `dynocar_estimators` has the papers' own methods and the list of all kinds
//! that a configuration may name; `dynocar_analysis` finds everything else that recorded runs show. Both are built on
//! this one.
//!
//! # Layout, in the order in which a sample passes
//!
//! - [`plausibility`]: whether samples can be true: wrong units, exchanged forces, reversed signs
//! - [`filter`]: recursive estimators of fixed size, without knowledge of trains
//! - [`pipeline`]: estimators behind one interface, from sample to snapshot
//! - [`trial`]: which of several models predicts better, judged while a train runs
//! - [`remedy`]: remedies for a reason or a refused sample
//!
//! # Examples
//!
//! ```
//! use std::sync::Arc;
//!
//! use dynocar_core::pipeline::train_kalman::{TrainKalman, TrainKalmanSettings};
//! use dynocar_core::pipeline::Pipeline;
//! use dynocar_model::train::{Davis, TrainModel};
//! use dynocar_shared::{SampleField, Status, TrainId, TrainSample};
//!
//! let resistance = Davis { a: 1.5, b: 0.01, c: 0.0005 };
//! let train = Arc::new(TrainModel::bare("metro", 200_000.0, resistance));
//! let estimator = TrainKalman::new(TrainKalmanSettings::default(), &train)?;
//! let mut pipeline = Pipeline::new(TrainId(1), 0, train, None, Box::new(estimator));
//!
//! let sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 21.5);
//! let snapshot = pipeline.process(&sample);
//! // One sample shows nothing yet.
//! assert_eq!(snapshot.status, Status::Unestimated as u32);
//! # Ok::<(), dynocar_core::pipeline::SettingError>(())
//! ```

pub mod filter;
pub mod pipeline;
pub mod plausibility;
pub mod remedy;
pub mod trial;
