//! An imitation of a daemon with one pipeline, for tests of controllers in other languages.
//!
//! `dynocar-played-daemon` prints its run-time directory, then every sample that it takes as a line of JSON. It answers
//! samples after the line `answer` on standard input, stops answering after the line `silence`, and ends at the end of
//! standard input.

use std::io::{BufRead, Write};
use std::sync::mpsc::{TryRecvError, channel};
use std::time::Duration;

use dynocar_shared::{SampleField, TrainSample};
use serde_json::{Value, json};

#[path = "../../../client/tests/support/mod.rs"]
mod support;
use support::PlayedDaemon;

fn described(sample: &TrainSample) -> Value {
    let values: Vec<Option<f64>> =
        SampleField::ALL.iter().map(|&field| sample.get(field)).collect();
    json!({
        "time_ns": sample.time_ns,
        "sequence": sample.sequence,
        "train_id": sample.train_id,
        "direction": sample.direction,
        "flags": sample.flags,
        "run": sample.run,
        "values": values,
    })
}

fn main() {
    let daemon = PlayedDaemon::start();
    let (sender, orders) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    let mut out = std::io::stdout().lock();
    let mut report = |value: Value| {
        writeln!(out, "{value}").and_then(|()| out.flush()).expect("a reader of standard output");
    };
    report(json!({ "root": daemon.root() }));
    let mut is_answering = false;
    loop {
        match orders.try_recv() {
            Ok(order) => is_answering = order == "answer",
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return,
        }
        while let Some(sample) = daemon.next_sample() {
            report(described(&sample));
            if is_answering {
                daemon.answer(&sample);
            }
        }
        std::thread::sleep(Duration::from_micros(500));
    }
}
