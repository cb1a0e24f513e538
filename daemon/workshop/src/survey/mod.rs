//! Raw recordings to a dataset on a surveyed line: reading, writing and reporting.
//!
//! - [`read`]: a dataset's runs as recordings; a line that was surveyed before
//! - [`write`](mod@write), [`trip_rows`]: the dataset folder with its trips
//! - `folder`: all of it in turn; [`material`]: what the files are made of, why nothing comes of it
//! - [`answer`]: the result for machines
//! - [`page`]: the result as a page

pub mod answer;
mod folder;
pub mod material;
pub mod page;
pub mod read;
pub mod trip_rows;
pub mod write;

pub use folder::{Surveyed, survey_folder};
pub use material::SurveyFailure;
