//! The live view: the layouts shipped for its viewers, and its process next to a controller and a daemon.

mod layouts;
mod process;
#[path = "../../../recording/tests/recording/support_site.rs"]
mod support_site;
