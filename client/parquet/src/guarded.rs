//! The library that reads Parquet takes some of a file's numbers for granted: where a damaged file breaks
//! that, it panics. For us that is an error of the file like any other.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::Once;

use crate::error::{TableError, TableProblem};

thread_local! {
    /// True while this thread reads a file: then a panic is no news.
    static IS_READING: Cell<bool> = const { Cell::new(false) };
}

/// Reads a file; what the library panics at is reported as the file's.
///
/// # Errors
///
/// As the work, and where the file makes the library panic.
pub fn guarded<T>(
    path: &Path,
    work: impl FnOnce() -> Result<T, TableProblem>,
) -> Result<T, TableError> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let former_hook = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_READING.get() {
                former_hook(panic);
            }
        }));
    });
    IS_READING.set(true);
    // What the work has half done is dropped with the error.
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_READING.set(false);
    let done = done.unwrap_or_else(|panic| {
        Err(TableProblem::NotParquet(format!("damaged: {}", words(panic.as_ref()))))
    });
    done.map_err(TableError::of(path))
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("unreadable")
}
