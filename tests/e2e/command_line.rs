//! Commands as a user runs them, and what is shipped with them.

#[path = "init/commands.rs"]
mod commands;
#[path = "init/guide.rs"]
mod guide;
#[path = "../../client/tests/support/mod.rs"]
mod support;

mod careless;
mod explain_again;
mod fmu;
mod import;
mod init;
mod init_refused;
mod learn;
mod learn_page;
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
