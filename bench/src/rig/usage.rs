//! What the kernel says of a process and its threads.

use std::path::{Path, PathBuf};

use super::cores::Cores;

/// Processor time and memory of a process at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProcessUsage {
    /// Processor time of all living threads, in s.
    pub cpu_s: f64,
    /// Resident memory in bytes.
    pub rss_bytes: u64,
}

/// A process's usage; `None` when it is gone.
pub fn of_process(process_id: u32) -> Option<ProcessUsage> {
    let folder = format!("/proc/{process_id}");
    let tasks = std::fs::read_dir(format!("{folder}/task")).ok()?;
    let cpu_ns: u64 = tasks.flatten().filter_map(|task| schedule_figure(&task.path(), 0)).sum();
    let pages = std::fs::read_to_string(format!("{folder}/statm")).ok()?;
    let pages: u64 = pages.split(' ').nth(1)?.parse().ok()?;
    Some(ProcessUsage {
        cpu_s: cpu_ns as f64 * 1e-9,
        rss_bytes: pages * rustix::param::page_size() as u64,
    })
}

/// A figure of `/proc/…/schedstat`: time on a processor, or ready and waiting for one, in ns.
fn schedule_figure(task: &Path, index: usize) -> Option<u64> {
    std::fs::read_to_string(task.join("schedstat")).ok()?.split(' ').nth(index)?.parse().ok()
}

/// For how long a task was ready but had no processor, in s; 0 when there is none.
fn wait_s(task: Option<&Path>) -> f64 {
    task.and_then(|task| schedule_figure(task, 1)).unwrap_or(0) as f64 * 1e-9
}

/// For how long the machine beneath kept a core from its kernel, in s, as far as it says so.
fn stolen_s(core: usize) -> f64 {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let name = format!("cpu{core} ");
    let line = stat.lines().find_map(|line| line.strip_prefix(&name));
    let ticks: Option<u64> = line.and_then(|line| line.split(' ').nth(7)?.parse().ok());
    ticks.unwrap_or(0) as f64 / rustix::param::clock_ticks_per_second() as f64
}

/// For how long so far, in s, the calling thread and a process's thread of this name were ready but had no
/// processor, and the machine beneath took their cores away.
pub fn waits_s(process_id: u32, name: &str, cores: Cores) -> [f64; 3] {
    let thread = task_named(process_id, name);
    [
        wait_s(Some(Path::new("/proc/thread-self"))),
        wait_s(thread.as_deref()),
        stolen_s(cores.controller) + stolen_s(cores.server),
    ]
}

/// Page faults of a process's thread of this name since it began, how often it waited of its own accord, and how
/// often it was made to wait for another; `None` when there is none.
pub fn of_thread(process_id: u32, name: &str) -> Option<[u64; 3]> {
    let task = task_named(process_id, name)?;
    let stat = std::fs::read_to_string(task.join("stat")).ok()?;
    let status = std::fs::read_to_string(task.join("status")).ok()?;
    let line = |key: &str| {
        status.lines().find_map(|line| line.strip_prefix(key)?.trim().parse::<u64>().ok())
    };
    let faults = stat_field(&stat, 10)? + stat_field(&stat, 12)?;
    Some([faults, line("voluntary_ctxt_switches:")?, line("nonvoluntary_ctxt_switches:")?])
}

fn task_named(process_id: u32, name: &str) -> Option<PathBuf> {
    let tasks = std::fs::read_dir(format!("/proc/{process_id}/task")).ok()?;
    tasks.flatten().map(|task| task.path()).find(|task| {
        std::fs::read_to_string(task.join("comm")).is_ok_and(|own| own.trim_end() == name)
    })
}

/// A field of `/proc/…/stat` by its number in proc(5); the name in field 2 may hold spaces.
fn stat_field(stat: &str, number: usize) -> Option<u64> {
    let after_name = &stat[stat.rfind(')')? + 2..];
    after_name.split(' ').nth(number - 3)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_has_memory_and_its_threads_are_found_by_name() {
        let id = std::process::id();
        let usage = of_process(id).unwrap();
        assert!(usage.rss_bytes > 100_000 && usage.cpu_s > 0.0);
        let usage = std::thread::Builder::new()
            .name("a name".into())
            .spawn(move || {
                // Beyond 32 MiB glibc never takes memory that was given back before.
                std::hint::black_box(vec![1_u8; 40 << 20]);
                of_thread(id, "a name")
            })
            .unwrap()
            .join()
            .unwrap();
        assert!(usage.is_some_and(|usage| usage[0] > 0));
        assert_eq!(of_thread(id, "nobody"), None);
    }

    #[test]
    fn waits_and_stolen_time_are_read_and_never_fall() {
        let cores = Cores { controller: 0, server: usize::MAX, priority: None };
        let before = waits_s(std::process::id(), "nobody", cores);
        std::thread::yield_now();
        let after = waits_s(std::process::id(), "nobody", cores);
        assert!(after[0] >= before[0] && after[2] >= before[2]);
        assert!(Path::new("/proc/thread-self/schedstat").exists());
        assert_eq!((after[1], stolen_s(usize::MAX)), (0.0, 0.0));
    }

    #[test]
    fn a_name_with_spaces_and_brackets_does_not_shift_the_fields() {
        let stat = "7 (a) b) S 1 2 3 4 5 6 77 8 99 10 11 12";
        assert_eq!(stat_field(stat, 10), Some(77));
        assert_eq!(stat_field(stat, 12), Some(99));
    }
}
