//! What the sources and the documents hold, looked at as text: one program, which is linked once.

mod circles;
mod documents;
mod explain_numbers;
mod layering;
mod promises;
mod sizes;
mod troubles;
mod unrun;
