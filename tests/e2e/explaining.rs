//! What `explain` finds, and what it does not.

mod declared_terms;
mod every_kind;
mod explain;
mod forms;
mod gradient_error;
mod late_speed;
mod told_by_data;
mod updated_model;
