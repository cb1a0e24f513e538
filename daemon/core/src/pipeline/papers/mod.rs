//! What the papers ask, one folder each: their own methods, kept as the papers have them, and ours at the
//! statistical bound of their experiments, where the mass or the resistance is exact. On a train neither is:
//! there [`super::train_kalman`] answers.
//!
//! - [`liu`] (Liu 2018): recursive least squares on segments of coasting
//! - [`xia`] (Xia 2023): a trajectory fit over a sliding window, and ours sample by sample
//! - [`wang`] (Wang 2022): resistance and mass in stages, by gradient descent, and ours by Kalman filters and least squares
//! - [`xie`] (Xie 2019, and Jin 2020 for the brake): expectation maximisation over a sliding window

pub mod liu;
pub mod wang;
pub mod xia;
pub mod xie;
