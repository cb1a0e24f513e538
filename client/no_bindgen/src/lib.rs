//! Nothing, in the place of bindgen and the fifteen crates below it.
//!
//! iceoryx2 0.10 lists bindgen among its build dependencies on every system and calls it on QNX alone:
//! `iceoryx2-pal-posix` behind `cfg(target_os = "nto")`, `iceoryx2-pal-os-api` nowhere. On a system that
//! calls it this fails to compile; there the `[patch]` of the workspace goes.
