//! Every estimator that a configuration may name: the papers' own methods, and the list of all kinds.
//!
//! The pipelines that serve a running train are in [`dynocar_core::pipeline`]: resistance and mass by
//! [`train_kalman`](dynocar_core::pipeline::train_kalman), the brake by [`braking`](dynocar_core::pipeline::braking),
//! missing effects by [`monitor`](dynocar_core::pipeline::monitor). This crate holds the methods of the papers, one
//! folder each, as published, and our own methods that reach the statistical bound of the papers' experiments, in which
//! the mass or the resistance is known exactly. On a real train neither is.
//!
//! - [`EstimatorSettings`]: every kind with its settings, of both libraries, and how it is built
//! - [`liu`], [`resistance`] (Liu 2018): recursive least squares on coasting or measured forces, and our robust Kalman
//!   filter
//! - [`xia`] (Xia 2023): a trajectory fit over a sliding window, and our fit sample by sample
//! - [`wang`] (Wang 2022): resistance and mass in stages, by gradient descent, and our Kalman filters and least squares
//! - [`xie`] (Xie 2019, and Jin 2020 for the brake): expectation maximisation over a sliding window
//!
//! As the core, this library knows no channel, clock, file, thread or logger.
//!
//! # Examples
//!
//! ```
//! use std::sync::Arc;
//!
//! use dynocar_estimators::EstimatorSettings;
//! use dynocar_model::train::{Davis, TrainModel};
//! use dynocar_shared::PipelineKind;
//!
//! let resistance = Davis { a: 1.5, b: 0.01, c: 0.0005 };
//! let train = Arc::new(TrainModel::bare("metro", 200_000.0, resistance));
//! let settings = EstimatorSettings::default_of(PipelineKind::MassKalman).expect("a kind that exists");
//! let estimator = settings.build(&train)?;
//! assert_eq!(estimator.kind(), PipelineKind::MassKalman);
//! # Ok::<(), dynocar_core::pipeline::SettingError>(())
//! ```

pub mod liu;
pub mod resistance;
mod settings;
pub mod wang;
pub mod xia;
pub mod xie;

pub use settings::EstimatorSettings;
