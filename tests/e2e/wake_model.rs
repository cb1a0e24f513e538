//! The protocol by which a pipeline thread falls asleep and a controller wakes it (decision 0003),
//! over every interleaving and every weak-memory outcome that loom knows.
//!
//! The channels between the two are the transport's; Dynocar adds the order: each side writes its word, then issues a
//! full fence, then reads the other's word.

use loom::sync::Arc;
use loom::sync::atomic::Ordering::{Relaxed, SeqCst};
use loom::sync::atomic::{AtomicU64, fence};
use loom::thread;

/// Tries to fall asleep during one publication; returns whether the thread sleeps and is not woken.
fn is_left_asleep(with_fences: bool) -> bool {
    let sample = Arc::new(AtomicU64::new(0));
    let sleeping = Arc::new(AtomicU64::new(0));
    let controller = {
        let (sample, sleeping) = (Arc::clone(&sample), Arc::clone(&sleeping));
        thread::spawn(move || {
            sample.store(1, Relaxed);
            if with_fences {
                fence(SeqCst);
            }
            // Notifies a sleeping thread.
            sleeping.load(Relaxed) == 1
        })
    };
    sleeping.store(1, Relaxed);
    if with_fences {
        fence(SeqCst);
    }
    let has_found_work = sample.load(Relaxed) == 1;
    let is_notified = controller.join().expect("no panic");
    !has_found_work && !is_notified
}

#[test]
fn a_thread_that_falls_asleep_next_to_a_publication_finds_it_or_is_woken() {
    loom::model(|| assert!(!is_left_asleep(true)));
}

#[test]
fn the_model_would_notice_a_missing_fence() {
    let found = std::panic::catch_unwind(|| loom::model(|| assert!(!is_left_asleep(false))));
    assert!(found.is_err(), "without the fences both may look past each other");
}
