//! An empty crate, in the place of bindgen and the fifteen crates below it.
//!
//! iceoryx2 0.10 lists bindgen among its build dependencies on every system and calls it on QNX alone:
//! `iceoryx2-pal-posix` behind `cfg(target_os = "nto")`, `iceoryx2-pal-os-api` nowhere. On a system that calls bindgen
//! this crate fails to compile; remove the `[patch]` of the workspace there.
