//! Stops against what was simulated, and `explain` on any number of threads.

mod modulated_stops;
mod stops;
mod threads;
