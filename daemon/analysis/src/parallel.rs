//! Work on the caller's threads: the results are in the order of the items, and the same on any number of threads
//! (decision 0018).
//!
//! The code that hands out work is compiled once, for calls through a pointer, and not again for each use.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

/// Returns the number of threads that share the work.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Returns the results of `make` for each number below a count.
pub fn of_each_number<R: Send>(count: usize, make: impl Fn(usize) -> R + Sync) -> Vec<R> {
    in_tasks(count, 1, make)
}

/// Returns the results of `make` for each number below a count, `at_least` of them in one task, since one alone is less
/// work than handing it to a thread.
pub fn in_tasks<R: Send>(
    count: usize,
    at_least: usize,
    make: impl Fn(usize) -> R + Sync,
) -> Vec<R> {
    let places: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    share_out(count, at_least, &|number| put(&places[number], make(number)));
    places
        .into_iter()
        .filter_map(|it| it.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect()
}

/// Returns the results of `make` for each item of a list.
pub fn of_each<T: Sync, R: Send>(items: &[T], make: impl Fn(&T) -> R + Sync) -> Vec<R> {
    of_each_number(items.len(), |number| make(&items[number]))
}

/// Returns the results of `make` for each item, which is consumed, and its number.
pub fn of_each_owned<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    make: impl Fn(usize, T) -> R + Sync,
) -> Vec<R> {
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|it| Mutex::new(Some(it))).collect();
    let made =
        of_each_number(items.len(), |number| taken(&items[number]).map(|item| make(number, item)));
    made.into_iter().flatten().collect()
}

fn share_out(count: usize, at_least: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_min_len(at_least).for_each(work);
}

fn put<R>(place: &Mutex<Option<R>>, made: R) {
    *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
}

fn taken<T>(place: &Mutex<Option<T>>) -> Option<T> {
    place.lock().unwrap_or_else(PoisonError::into_inner).take()
}
