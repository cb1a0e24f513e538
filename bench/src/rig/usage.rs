//! Counters of the kernel for a process and its threads.

use std::path::{Path, PathBuf};

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
pub fn of(process_id: u32, thread: &str) -> ProcessUsage {
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
        let usage = of(id, "nobody");
        assert!(usage.rss_bytes > 100_000 && usage.cpu_s > 0.0);
        assert_eq!((usage.waits_s[1], usage.preempted), (0.0, 0));
        let switches = std::thread::Builder::new().name("a name".into()).spawn(move || {
            // On few cores, a thread that never rests is made to wait while others never rest either.
            let start = std::time::Instant::now();
            while of(id, "a name").preempted == 0 && start.elapsed().as_secs() < 20 {}
            of(id, "a name").preempted
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
        let before = of(std::process::id(), "nobody");
        std::thread::yield_now();
        assert!(of(std::process::id(), "nobody").waits_s[0] >= before.waits_s[0]);
        assert!(Path::new("/proc/thread-self/schedstat").exists());
    }
}
