//! What the kernel says of a process and its threads.

use std::path::{Path, PathBuf};

use serde::Serialize;

/// Processor time and memory of a process at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProcessUsage {
    /// Processor time of all living threads, in s.
    pub cpu_s: f64,
    /// Resident memory in bytes.
    pub rss_bytes: u64,
}

/// What one thread has suffered since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ThreadUsage {
    /// Page faults answered without the disk.
    pub minor_faults: u64,
    /// Page faults answered from the disk.
    pub major_faults: u64,
    /// Times it waited of its own accord.
    pub voluntary_switches: u64,
    /// Times it was made to wait for another.
    pub involuntary_switches: u64,
}

impl ThreadUsage {
    /// What came since an earlier moment.
    pub fn since(&self, earlier: &ThreadUsage) -> ThreadUsage {
        ThreadUsage {
            minor_faults: self.minor_faults - earlier.minor_faults,
            major_faults: self.major_faults - earlier.major_faults,
            voluntary_switches: self.voluntary_switches - earlier.voluntary_switches,
            involuntary_switches: self.involuntary_switches - earlier.involuntary_switches,
        }
    }
}

impl std::ops::AddAssign for ThreadUsage {
    fn add_assign(&mut self, other: ThreadUsage) {
        self.minor_faults += other.minor_faults;
        self.major_faults += other.major_faults;
        self.voluntary_switches += other.voluntary_switches;
        self.involuntary_switches += other.involuntary_switches;
    }
}

/// A process's usage; `None` when it is gone.
pub fn of_process(process_id: u32) -> Option<ProcessUsage> {
    let folder = format!("/proc/{process_id}");
    let tasks = std::fs::read_dir(format!("{folder}/task")).ok()?;
    let cpu_ns: u64 = tasks.flatten().filter_map(|task| run_time_ns(&task.path())).sum();
    let pages = std::fs::read_to_string(format!("{folder}/statm")).ok()?;
    let pages: u64 = pages.split(' ').nth(1)?.parse().ok()?;
    Some(ProcessUsage {
        cpu_s: cpu_ns as f64 * 1e-9,
        rss_bytes: pages * rustix::param::page_size() as u64,
    })
}

/// A thread's time on a processor; finer than the ticks of `/proc/…/stat`.
fn run_time_ns(task: &Path) -> Option<u64> {
    schedule_figure(task, 0)
}

/// A figure of `/proc/…/schedstat`: time on a processor, or ready and waiting for one, in ns.
fn schedule_figure(task: &Path, index: usize) -> Option<u64> {
    std::fs::read_to_string(task.join("schedstat")).ok()?.split(' ').nth(index)?.parse().ok()
}

/// For how long the calling thread was ready but had no processor, in s.
pub fn own_wait_s() -> f64 {
    schedule_figure(Path::new("/proc/thread-self"), 1).unwrap_or(0) as f64 * 1e-9
}

/// The same for a process's thread of this name; 0 when there is none.
pub fn thread_wait_s(process_id: u32, name: &str) -> f64 {
    let wait_ns = task_named(process_id, name).and_then(|task| schedule_figure(&task, 1));
    wait_ns.unwrap_or(0) as f64 * 1e-9
}

/// For how long the machine beneath kept a core from its kernel, in s, as far as it says so.
pub fn stolen_s(core: usize) -> f64 {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let name = format!("cpu{core} ");
    let line = stat.lines().find_map(|line| line.strip_prefix(&name));
    let ticks: Option<u64> = line.and_then(|line| line.split(' ').nth(7)?.parse().ok());
    ticks.unwrap_or(0) as f64 / rustix::param::clock_ticks_per_second() as f64
}

/// The usage of a process's thread of this name; `None` when there is none.
pub fn of_thread(process_id: u32, name: &str) -> Option<ThreadUsage> {
    task_named(process_id, name).and_then(|task| read_thread(&task))
}

fn task_named(process_id: u32, name: &str) -> Option<PathBuf> {
    let tasks = std::fs::read_dir(format!("/proc/{process_id}/task")).ok()?;
    tasks.flatten().map(|task| task.path()).find(|task| {
        std::fs::read_to_string(task.join("comm")).is_ok_and(|own| own.trim_end() == name)
    })
}

fn read_thread(task: &Path) -> Option<ThreadUsage> {
    let stat = std::fs::read_to_string(task.join("stat")).ok()?;
    let status = std::fs::read_to_string(task.join("status")).ok()?;
    let line = |key: &str| {
        status.lines().find_map(|line| line.strip_prefix(key)?.trim().parse::<u64>().ok())
    };
    Some(ThreadUsage {
        minor_faults: stat_field(&stat, 10)?,
        major_faults: stat_field(&stat, 12)?,
        voluntary_switches: line("voluntary_ctxt_switches:")?,
        involuntary_switches: line("nonvoluntary_ctxt_switches:")?,
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
        assert!(usage.is_some_and(|usage| usage.minor_faults > 0));
        assert_eq!(of_thread(id, "nobody"), None);
    }

    #[test]
    fn waits_and_stolen_time_are_read_and_never_fall() {
        let before = (own_wait_s(), stolen_s(0));
        std::thread::yield_now();
        assert!(own_wait_s() >= before.0 && stolen_s(0) >= before.1);
        assert!(std::path::Path::new("/proc/thread-self/schedstat").exists());
        assert_eq!(thread_wait_s(std::process::id(), "nobody"), 0.0);
        assert_eq!(stolen_s(usize::MAX), 0.0);
    }

    #[test]
    fn a_name_with_spaces_and_brackets_does_not_shift_the_fields() {
        let stat = "7 (a) b) S 1 2 3 4 5 6 77 8 99 10 11 12";
        assert_eq!(stat_field(stat, 10), Some(77));
        assert_eq!(stat_field(stat, 12), Some(99));
    }
}
