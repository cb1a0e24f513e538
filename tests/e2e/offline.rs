//! Tests that wait for no controller's cycle: commands as a user runs them, findings of `explain`, the simulator of
//! trains, the sources and documents as text, and stress tests that count samples and do not depend on the speed of the
//! machine.

#[path = "init/commands.rs"]
mod commands;
#[path = "init/guide.rs"]
mod guide;
#[path = "../simulator/mod.rs"]
mod simulator;
#[path = "../../client/tests/support/mod.rs"]
mod support;

// Commands, and the files that are shipped with them.
mod brakes;
mod careless;
mod check;
mod explain_again;
mod fmu;
mod foreign_direction;
mod foreign_files;
mod foreign_parts;
mod foreign_relatives;
mod identify;
mod import;
mod init;
mod init_refused;
mod learn;
mod learn_page;
mod learn_workplace;
mod logger_files;
mod output;
mod own_train;
mod package;
mod report;
mod report_pointer;
mod shipped;
mod stops;
mod survey_command;
mod two_programs;
mod two_trains;

// Findings of `explain`, and their limits.
mod declared_terms;
mod explain;
mod explained;
mod forms;
mod gradient_error;
mod late_speed;
mod told_by_data;
mod updated_model;

// Bad samples, mutated bytes, power cuts, months of them, and eight trains with faults.
mod bad_samples;
mod power_cut;
mod power_cut_recordings;
mod soak;

// Sources and documents.
mod circles;
mod documents;
mod explain_numbers;
mod layering;
mod pages;
mod promises;
mod sizes;
mod toml_keys;
mod troubles;
mod unrun;
mod words;
