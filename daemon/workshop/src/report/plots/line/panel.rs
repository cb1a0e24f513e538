//! A property of the line: its data, their range, what a pointer reads of them.

use dynocar_analysis::explain::report::line::MarkedInterval;
use dynocar_analysis::explain::report::panels::PanelBin;

use crate::report::plots::axes::range_with_zero;
use crate::report::plots::panel::{reading, vertical_range};
use crate::report::plots::reading::Reading;

/// Nominal height in px of a panel, of one that shows places only, and of a row of places more.
const HEIGHT: u32 = 190;
const PLACES_HEIGHT: u32 = 90;
const ROW_HEIGHT: u32 = 26;
/// One property of the line.
pub(super) struct Panel {
    pub name: String,
    pub unit: &'static str,
    pub content: Content,
}

pub(super) enum Content {
    /// (Chainage in km, value), and half widths of 95 % intervals where they are known.
    Line { points: Vec<(f64, f64)>, halves: Vec<f64> },
    /// Where an effect was found.
    Places(Vec<MarkedInterval>),
    /// The residual for travel towards growing (+1) or falling (−1) chainage.
    Means(f64, Vec<PanelBin>),
}

impl Panel {
    pub fn title(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{}, {}", self.name, self.unit)
        }
    }

    pub fn height(&self) -> u32 {
        match &self.content {
            Content::Places(sections) => {
                PLACES_HEIGHT + ROW_HEIGHT * (rows(sections).len() as u32 - 1)
            }
            _ => HEIGHT,
        }
    }

    pub fn range(&self, has_effect: bool) -> [f64; 2] {
        match &self.content {
            Content::Places(_) => [0.0, 1.0],
            Content::Means(_, bins) => vertical_range(bins, has_effect),
            Content::Line { points, .. } => {
                let mut y = range_with_zero(points.iter().map(|point| point.1));
                if points.iter().all(|point| point.1 >= 0.0) {
                    y[0] = 0.0;
                }
                y
            }
        }
    }

    pub fn reading(&self, has_effect: bool) -> Reading {
        match &self.content {
            Content::Places(_) => Reading::new("Chainage", "km", false, Vec::new()),
            Content::Means(direction, bins) => {
                let mut reading = reading("Chainage", "km", bins, has_effect);
                // What is not drawn is not read.
                reading.series.truncate(1 + usize::from(has_effect));
                let direction_label = direction_label(*direction);
                reading.series.iter_mut().for_each(|it| it.name += &format!(", {direction_label}"));
                reading
            }
            Content::Line { points, halves } => {
                let (at, values) = points.iter().copied().unzip();
                let reading = Reading::new("Chainage", "km", false, at);
                reading.with(&self.name[..], self.unit, values, halves.clone())
            }
        }
    }

    /// What it shows, for those who do not see it.
    pub fn described(&self) -> String {
        match &self.content {
            Content::Places(sections) => format!("{} {}", self.name, described(sections)),
            Content::Means(_, bins) => {
                let most = bins.iter().map(|bin| bin.before_n_per_kn.0.abs()).fold(0.0, f64::max);
                format!("{}: at most {most:.2} N/kN", self.name)
            }
            Content::Line { points, .. } => {
                let values = || points.iter().map(|point| point.1);
                let low = values().fold(f64::INFINITY, f64::min);
                let high = values().fold(f64::NEG_INFINITY, f64::max);
                format!("{} from {low:.1} to {high:.1}", self.title())
            }
        }
    }
}

/// A direction of travel, in words.
pub(super) fn direction_label(direction: f64) -> &'static str {
    if direction > 0.0 { "growing chainage" } else { "falling chainage" }
}

/// The rows of a panel of places: what holds in all runs, or one row for each run.
pub(super) fn rows(sections: &[MarkedInterval]) -> Vec<Option<&str>> {
    let mut rows: Vec<Option<&str>> = sections.iter().map(|it| it.run.as_deref()).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// The sections in words.
pub(super) fn described(sections: &[MarkedInterval]) -> String {
    let one = |it: &MarkedInterval| {
        let run = it.run.as_ref().map_or(String::new(), |run| format!(" in {run}"));
        format!("km {:.2} to {:.2}{run}", it.at_m[0] / 1e3, it.at_m[1] / 1e3)
    };
    sections.iter().map(one).collect::<Vec<_>>().join(", ")
}
