//! The papers' own methods, each thin on the common front end, and kept as the papers have them: the
//! yardsticks of our own, and pipelines that one can choose.
//!
//! - [`liu`] (Liu 2018): recursive least squares on segments of coasting
//! - [`xia`] (Xia 2023): a trajectory fit over a sliding window
//! - [`wang`] (Wang 2022): resistance and mass in stages, by gradient descent
//! - [`xie`] (Xie 2019, and Jin 2020 for the brake): expectation maximisation over a sliding window

pub mod liu;
pub mod wang;
pub mod xia;
pub mod xie;
