//! The daemon, its command line and its files.
//!
//! # Layout
//!
//! - [`cli`]: the commands of `dynocar`, one file each
//! - [`config`]: the daemon's configuration
//! - [`dataset`]: recorded runs from disk
//! - [`ending`]: when a long-running program ends
//! - [`identify`]: the pipelines over recorded runs
//! - [`fmu`]: the estimators as an FMU
//! - [`annotation`]: an explanation beside the data that it explains
//! - [`learn`]: recorded runs into candidates for the store
//! - [`models`]: a store of models
//! - [`grown`]: the model with its effects as train and track files, and a dataset of them
//! - [`operator`]: what an operator reads, in one place
//! - [`output`]: where results go
//! - [`paths`]: files as seen from a folder
//! - [`pipelines`]: the pipelines that a configuration asks for
//! - [`programs`]: commands that are programs of their own
//! - [`report`]: an explanation as a page of HTML
//! - [`demo`]: the main job as a show
//! - [`run`]: the daemon, every stage on one screen
//! - [`run_facts`]: what is shown of a recorded run
//! - [`runtime`]: its threads
//! - [`shadow`]: models on trial, and the change from one to another
//! - [`state`]: estimates that outlive the daemon
//! - [`storage`]: files that are replaced as a whole
//! - [`supervision`]: what a supervisor and an operator see of the daemon
//! - [`survey`]: raw recordings to a dataset on a surveyed line
//! - [`text_file`]: text files from disk
//! - [`track_text`]: the text of a line's file
//! - [`unpacking`]: recordings as datasets
//! - [`replay`]: recorded runs into the sample channel

pub mod annotation;
pub mod cli;
pub mod config;
pub mod dataset;
pub mod demo;
pub mod ending;
pub mod fmu;
pub mod grown;
pub mod identify;
pub mod learn;
pub mod models;
pub mod operator;
pub mod output;
pub mod paths;
pub mod pipelines;
pub mod programs;
pub mod replay;
pub mod report;
pub mod run;
pub mod run_facts;
pub mod runtime;
pub mod shadow;
pub mod state;
pub mod storage;
pub mod supervision;
pub mod survey;
pub mod text_file;
pub mod track_text;
pub mod unpacking;
