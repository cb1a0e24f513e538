//! A headless Chromium that opens pages and reports their state.
//!
//! The tests speak with it by the DevTools protocol over two pipes (`--remote-debugging-pipe`): messages of JSON, each
//! ended by a zero byte. No port is opened.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process_group};
use serde_json::{Value, json};
use tempfile::TempDir;

/// How long an answer of the browser may take; a loaded machine starts it slowly.
const PATIENCE: Duration = Duration::from_secs(120);

const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Start without sandbox (the tests may run as root), without network access of its own, and with the test's profile
/// alone.
const ARGUMENTS: &str = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run \
    --disable-background-networking --disable-component-update --disable-sync \
    --disable-dev-shm-usage --disable-breakpad --remote-debugging-pipe";

/// Conduct of a page while it was opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conduct {
    /// Errors and warnings of console, scripts and loading.
    pub console_errors: Vec<String>,
    /// Addresses it asked for, its own first.
    pub requests: Vec<String>,
}

/// A running browser with one tab; killed when dropped.
pub struct Browser {
    child: Child,
    requests: ChildStdin,
    messages: Receiver<Value>,
    session: String,
    last_id: u64,
    conduct: Conduct,
    has_loaded: bool,
    _profile: TempDir,
}

/// Returns the path of the browser's program; installs it by `tests/install_browser.sh` where there is none.
///
/// # Panics
///
/// When there is none and it cannot be installed.
pub fn program() -> &'static PathBuf {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        found().unwrap_or_else(|| {
            let script = concat!(env!("CARGO_MANIFEST_DIR"), "/install_browser.sh");
            let status = Command::new("sh").arg(script).stdin(Stdio::null()).status();
            let status = status.expect("sh to start");
            assert!(status.success(), "{script} could not install a browser: {status}");
            found().expect("a browser after its installation")
        })
    })
}

fn found() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let all = NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    all.into_iter().find(|file| file.is_file())
}

impl Browser {
    /// Starts a browser whose window has this width in px.
    ///
    /// # Panics
    ///
    /// When it cannot be had or does not answer.
    pub fn start(width_px: u32, is_dark: bool) -> Self {
        let profile = TempDir::new().expect("a folder for the browser's profile");
        // The browser takes requests on descriptor 3 and answers on descriptor 4.
        let script = format!("exec \"$0\" {ARGUMENTS} --user-data-dir=\"$1\" 3<&0 4>&1 >/dev/null");
        let mut child = Command::new("sh")
            .args(["-c", &script])
            .args([program().as_path(), profile.path()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .expect("the browser to start");
        let requests = child.stdin.take().expect("a piped standard input");
        let answers = BufReader::new(child.stdout.take().expect("a piped standard output"));
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            for message in answers.split(0).map_while(Result::ok) {
                let value = serde_json::from_slice(&message).expect("JSON from the browser");
                if sender.send(value).is_err() {
                    break;
                }
            }
        });
        let mut browser = Browser {
            child,
            requests,
            messages,
            session: String::new(),
            last_id: 0,
            conduct: Conduct::default(),
            has_loaded: false,
            _profile: profile,
        };
        browser.attach(width_px, is_dark);
        browser
    }

    fn attach(&mut self, width_px: u32, is_dark: bool) {
        let target = self.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached = self.call(
            "Target.attachToTarget",
            json!({ "targetId": target["targetId"], "flatten": true }),
        );
        self.session = attached["sessionId"].as_str().expect("a session").into();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
        self.show(width_px, is_dark);
    }

    /// Gives the window another width in px, and pages the one or the other scheme of colours.
    ///
    /// # Panics
    ///
    /// When the browser is gone.
    pub fn show(&mut self, width_px: u32, is_dark: bool) {
        let metrics = json!({
            "width": width_px, "height": 900, "deviceScaleFactor": 1, "mobile": width_px < 600
        });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
        let scheme = if is_dark { "dark" } else { "light" };
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Opens an address and waits until it is loaded.
    ///
    /// # Panics
    ///
    /// When it cannot be opened.
    pub fn open(&mut self, address: &str) {
        self.conduct = Conduct::default();
        self.has_loaded = false;
        let opened = self.call("Page.navigate", json!({ "url": address }));
        assert!(opened["errorText"].is_null(), "{address}: {}", opened["errorText"]);
        while !self.has_loaded {
            let message = self.next("the page to load");
            self.note(&message);
        }
    }

    /// Returns the value of a script's expression in the page.
    ///
    /// # Panics
    ///
    /// When the script fails.
    pub fn value(&mut self, script: &str) -> Value {
        let parameters = json!({ "expression": script, "returnByValue": true });
        let mut answer = self.call("Runtime.evaluate", parameters);
        assert!(answer["exceptionDetails"].is_null(), "{script}: {answer:#}");
        answer["result"]["value"].take()
    }

    /// Turns scripts of pages opened from now on off.
    ///
    /// # Panics
    ///
    /// When the browser is gone.
    pub fn forbid_scripts(&mut self) {
        self.call("Emulation.setScriptExecutionDisabled", json!({ "value": true }));
    }

    /// Moves the mouse to a place in the window, presses it or lets it go there (`mouseMoved`,
    /// `mousePressed`, `mouseReleased`), as the count-th click in a row.
    ///
    /// # Panics
    ///
    /// When the browser is gone.
    pub fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], clicks: u32) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let event = json!({ "type": kind, "x": x, "y": y, "button": button, "clickCount": clicks });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Presses a key by its name and lets it go.
    ///
    /// # Panics
    ///
    /// When the browser is gone.
    pub fn key(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.call("Input.dispatchKeyEvent", json!({ "type": kind, "key": key }));
        }
    }

    /// Returns the conduct of the page since it was opened.
    ///
    /// # Panics
    ///
    /// When the browser is gone.
    pub fn conduct(&mut self) -> Conduct {
        // Bytes before the answer to a later request have been read with it.
        self.value("new Promise(done => requestAnimationFrame(done)), 0");
        self.conduct.clone()
    }

    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let mut request = json!({ "id": self.last_id, "method": method, "params": parameters });
        if !self.session.is_empty() {
            request["sessionId"] = json!(self.session);
        }
        let mut bytes = request.to_string().into_bytes();
        bytes.push(0);
        self.requests.write_all(&bytes).expect("the browser to take a request");
        loop {
            let mut message = self.next(method);
            if message["id"] == json!(self.last_id) {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].take();
            }
            self.note(&message);
        }
    }

    fn next(&self, awaited: &str) -> Value {
        self.messages
            .recv_timeout(PATIENCE)
            .unwrap_or_else(|error| panic!("the browser does not answer ({awaited}): {error}"))
    }

    /// Records an event of the page.
    fn note(&mut self, message: &Value) {
        let parameters = &message["params"];
        let text = |value: &Value| value.to_string();
        match message["method"].as_str().unwrap_or("") {
            "Page.loadEventFired" => self.has_loaded = true,
            "Runtime.exceptionThrown" => self.conduct.console_errors.push(text(parameters)),
            "Runtime.consoleAPICalled"
                if ["error", "warning", "assert"]
                    .contains(&parameters["type"].as_str().unwrap_or("")) =>
            {
                self.conduct.console_errors.push(text(&parameters["args"]));
            }
            "Log.entryAdded" => self.conduct.console_errors.push(text(&parameters["entry"])),
            "Network.requestWillBeSent" => {
                let address = parameters["request"]["url"].as_str().unwrap_or("").to_string();
                self.conduct.requests.push(address);
            }
            _ => {}
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // The browser has children of its own; a group that is gone needs no killing.
        if let Some(group) = Pid::from_raw(self.child.id() as i32) {
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.child.wait();
    }
}
