//! What is published of trains, and brokers of every kind.

mod broker;
mod library;
