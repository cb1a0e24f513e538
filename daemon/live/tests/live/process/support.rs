//! A live view next to a daemon and a controller.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};

use dynocar_shared::TrainSample;
use rustix::process::{Pid, Signal, kill_process};

use crate::support_site::{Controller, TestSite, await_true};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_dynocar-live");

/// A live view; killed when it is dropped.
pub struct Live {
    process: Child,
    printed: Arc<Mutex<String>>,
    pub port: u16,
}

impl Live {
    /// Starts a live view on a free port, and waits until it serves.
    pub fn beside(site: &TestSite, options: &[&str]) -> Self {
        let mut process = Command::new(PROGRAM)
            .args(["--port", "0", "--root"])
            .arg(site.at("root"))
            .args(options)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let printed = Arc::new(Mutex::new(String::new()));
        let listening = Arc::clone(&printed);
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                *listening.lock().unwrap() += &(line + "\n");
            }
        });
        let mut live = Live { process, printed, port: 0 };
        live.await_reported("serving ws://127.0.0.1:");
        let printed = live.printed();
        let address = printed.split("ws://127.0.0.1:").nth(1).unwrap();
        live.port = address.split(';').next().unwrap().parse().unwrap();
        live
    }

    pub fn printed(&self) -> String {
        self.printed.lock().unwrap().clone()
    }

    pub fn await_reported(&self, words: &str) {
        await_true(words, || self.printed().contains(words));
    }

    /// Asks it to end, and gives its exit status.
    pub fn interrupt(&mut self) -> Option<i32> {
        let id = Pid::from_raw(self.process.id() as i32).unwrap();
        kill_process(id, Signal::INT).unwrap();
        let mut status = None;
        await_true("the end", || {
            status = self.process.try_wait().unwrap();
            status.is_some()
        });
        status.unwrap().code()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // One that has ended is not there to be killed.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The sample of a number.
pub fn published_sample(controller: &Controller, sequence: u64) -> TrainSample {
    let found = |it: &&TrainSample| it.sequence == sequence;
    let mut sample = None;
    await_true("the sample to be noted down", || {
        sample = controller.published().iter().find(found).copied();
        sample.is_some()
    });
    sample.unwrap()
}
