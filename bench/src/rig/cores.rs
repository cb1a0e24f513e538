//! Cores and priorities of a measurement, and the kernel's counters of a process and its threads.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use dynocar::output::report_line;
use dynocar::runtime::system::{pin_to_core, set_fifo_priority};

/// The two cores of a measurement, and the priority of the threads on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cores {
    /// Core on which the controller publishes and polls.
    pub controller: usize,
    /// Core of the answering thread.
    pub server: usize,
    /// Real-time priority on both; ordinary when absent.
    pub priority: Option<u8>,
}

/// Where a measurement of processes runs.
#[derive(Clone, Copy, Debug, Args)]
pub struct CoreArguments {
    /// Core of the controller, or of the publishers
    #[arg(long, value_name = "CORE")]
    controller_core: Option<usize>,
    /// Core of the daemon's thread, or of the other answering side
    #[arg(long, value_name = "CORE")]
    daemon_core: Option<usize>,
    /// Real-time priority (SCHED_FIFO) of the controller and of the answering side, 1 to 99
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Seed of everything drawn
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Cores {
    /// Returns the cores asked for, else the first two; on a machine with one core both are the same.
    pub fn choose(asked: &CoreArguments) -> Self {
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let controller = asked.controller_core.unwrap_or(0);
        let other = (controller + 1) % count.max(1);
        let server = asked.daemon_core.unwrap_or(other);
        report_shared(&[controller, server]);
        Cores { controller, server, priority: asked.priority }
    }
}

/// How long the cores are watched before a measurement.
const LOOK: Duration = Duration::from_millis(250);
/// A greater share of a core than this is somebody's work, in percent.
const TAKEN_PERCENT: u64 = 15;

/// Says which cores others take time of, before anything is measured on them.
fn report_shared(cores: &[usize]) {
    let before: Vec<_> = cores.iter().map(|&core| times_of(core)).collect();
    std::thread::sleep(LOOK);
    for (&core, before) in cores.iter().zip(before) {
        let Some((busy_before, all_before)) = before else { continue };
        let Some((busy, all)) = times_of(core) else { continue };
        // The time of waiting for a disk may fall.
        let percent =
            100 * busy.saturating_sub(busy_before) / all.saturating_sub(all_before).max(1);
        if percent > TAKEN_PERCENT {
            report_line(&format!(
                "dynocar-bench: core {core} is not its own: others take {percent} % of it, and figures will be \
                 wrong; end them, or name another core"
            ));
        }
    }
}

/// Busy and all ticks of a core since the system started.
fn times_of(core: usize) -> Option<(u64, u64)> {
    let stat = std::fs::read_to_string("/proc/stat").ok()?;
    let line = stat.lines().find_map(|line| line.strip_prefix(&format!("cpu{core} ")))?;
    // user nice system idle iowait irq softirq steal; guests are counted among the users.
    let ticks: Vec<u64> = line.split_whitespace().take(8).flat_map(str::parse).collect();
    let [_, _, _, idle, waiting, ..] = ticks[..] else { return None };
    let all = ticks.iter().sum();
    Some((all - idle - waiting, all))
}

/// Runs something in a thread of its own, which it may bind to a core: threads and processes
/// that are started before are not bound with it.
pub fn in_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| match scope.spawn(work).join() {
        Ok(result) => result,
        Err(panic) => std::panic::resume_unwind(panic),
    })
}

/// Binds the calling thread to a core; without that the figures vary more, which is said.
pub fn bind(core: usize) {
    said(&format!("not bound to core {core}"), pin_to_core(core));
}

/// Gives the calling thread, and every thread it starts from then on, a real-time priority; without
/// it the figures vary more, which is said.
pub fn prioritise(priority: Option<u8>) {
    if let Some(priority) = priority {
        said(&format!("no priority {priority}"), set_fifo_priority(priority));
    }
}

fn said<E: std::fmt::Display>(lacking: &str, result: Result<(), E>) {
    if let Err(error) = result {
        report_line(&format!("dynocar-bench: {lacking}, figures will vary more: {error}"));
    }
}

/// Values of the kernel's counters so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProcessUsage {
    /// Processor time of all living threads of the process, in s.
    pub cpu_s: f64,
    /// Its resident memory in bytes.
    pub rss_bytes: u64,
    /// For how long, in s, the calling thread and the named one were ready but had no processor.
    pub waits_s: [f64; 2],
    /// How often the kernel preempted the named thread.
    pub preempted: u64,
}

/// Returns the usage of a process, of which one thread is named; zeros where the process or the thread does not exist.
pub fn process_usage(process_id: u32, thread: &str) -> ProcessUsage {
    let folder = format!("/proc/{process_id}");
    let tasks = std::fs::read_dir(format!("{folder}/task")).into_iter().flatten().flatten();
    let tasks: Vec<PathBuf> = tasks.map(|task| task.path()).collect();
    let text = |path: PathBuf| std::fs::read_to_string(path).unwrap_or_default();
    let named = tasks.iter().find(|task| text(task.join("comm")).trim_end() == thread);
    let pages = text(PathBuf::from(folder).join("statm"));
    let status = named.map_or_else(String::new, |task| text(task.join("status")));
    let preempted = status.lines().find_map(|it| it.strip_prefix("nonvoluntary_ctxt_switches:"));
    let wait_s = |task: &Path| 1e-9 * schedule_ns(task, 1);
    ProcessUsage {
        cpu_s: tasks.iter().map(|task| 1e-9 * schedule_ns(task, 0)).sum(),
        rss_bytes: number(pages.split(' ').nth(1)) * rustix::param::page_size() as u64,
        waits_s: [wait_s(Path::new("/proc/thread-self")), named.map_or(0.0, |task| wait_s(task))],
        preempted: number(preempted),
    }
}

fn number(text: Option<&str>) -> u64 {
    text.and_then(|it| it.trim().parse().ok()).unwrap_or(0)
}

/// Returns a figure of `/proc/…/schedstat`: time on a processor, or ready and waiting for one, in ns.
fn schedule_ns(task: &Path, index: usize) -> f64 {
    let text = std::fs::read_to_string(task.join("schedstat")).unwrap_or_default();
    number(text.split(' ').nth(index)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_has_memory_and_its_threads_are_found_by_name() {
        let id = std::process::id();
        let usage = process_usage(id, "nobody");
        assert!(usage.rss_bytes > 100_000 && usage.cpu_s > 0.0);
        assert_eq!((usage.waits_s[1], usage.preempted), (0.0, 0));
        let switches = std::thread::Builder::new().name("a name".into()).spawn(move || {
            // On few cores, a thread that never rests is made to wait while others never rest either.
            let start = std::time::Instant::now();
            while process_usage(id, "a name").preempted == 0 && start.elapsed().as_secs() < 20 {}
            process_usage(id, "a name").preempted
        });
        let more = (0..4).map(|_| {
            std::thread::spawn(|| {
                let start = std::time::Instant::now();
                while start.elapsed().as_millis() < 300 {
                    std::hint::spin_loop();
                }
            })
        });
        more.collect::<Vec<_>>().into_iter().for_each(|it| it.join().unwrap());
        assert!(switches.unwrap().join().unwrap() > 0);
    }

    #[test]
    fn waits_never_fall() {
        let before = process_usage(std::process::id(), "nobody");
        std::thread::yield_now();
        assert!(process_usage(std::process::id(), "nobody").waits_s[0] >= before.waits_s[0]);
        assert!(Path::new("/proc/thread-self/schedstat").exists());
    }
}
