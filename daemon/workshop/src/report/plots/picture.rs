//! Base of all plots: canvas, colours, the sizes of pages, figures.
//!
//! Each plot is drawn at twice its nominal size, so that the whole pixels of the backend are fine
//! enough, and scaled by the page. The colours are those of the light page; the page's style
//! replaces each by a variable ([`colour_rules`]), so that they follow the reader's scheme.

use std::fmt::Write as _;
use std::io;

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::RGBColor;
use serde_json::json;

use super::reading::{self, PointerReading};
use crate::report::html::escape;

/// Returns the name of the model without effects, as plots show it next to the data.
pub(super) fn before_name(has_effect: bool) -> &'static str {
    if has_effect { "before" } else { "model" }
}

/// Area on which charts are drawn.
pub(super) type Area<'t> = DrawingArea<SVGBackend<'t>, Shift>;

/// Error of the drawing backend.
pub(super) type DrawError = DrawingAreaErrorKind<io::Error>;

/// Error of a plot that cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the plot of {plot} cannot be drawn: {source}")]
pub struct PlotError {
    /// Contents of the plot.
    plot: String,
    /// Why.
    source: DrawError,
}

/// A plot: the picture, and the values that a pointer reads from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// The picture, for the page.
    pub svg: String,
    /// The data of its charts, from the top.
    pub readings: Vec<PointerReading>,
}

/// Where a chart lies in its drawing: left, top, right, bottom, lower end of the labels below it;
/// least and greatest value of its horizontal axis.
pub(super) type Frame = [f64; 7];

/// Drawn over nominal size.
pub(super) const SCALE: u32 = 2;

pub(super) const TEXT: RGBColor = RGBColor(0x54, 0x5B, 0x66);
pub(super) const GRID: RGBColor = RGBColor(0xE3, 0xE6, 0xEA);
pub(super) const AXIS: RGBColor = RGBColor(0x9A, 0xA1, 0xAC);
pub(super) const MEASURED: RGBColor = RGBColor(0x23, 0x28, 0x30);
pub(super) const BEFORE: RGBColor = RGBColor(0xB8, 0x5C, 0x14);
pub(super) const AFTER: RGBColor = RGBColor(0x1B, 0x62, 0xA5);
pub(super) const ACTING: RGBColor = RGBColor(0xE4, 0xEE, 0xF7);
pub(super) const BAND: RGBColor = RGBColor(0xD9, 0xC3, 0xAE);
pub(super) const TUNNEL: RGBColor = RGBColor(0xE2, 0xE3, 0xE7);

/// The colours with the page's variables for them.
const INKS: [(RGBColor, &str); 9] = [
    (TEXT, "--muted"),
    (GRID, "--grid"),
    (AXIS, "--axis"),
    (MEASURED, "--measured"),
    (BEFORE, "--before"),
    (AFTER, "--after"),
    (ACTING, "--acting"),
    (BAND, "--band"),
    (TUNNEL, "--tunnel"),
];

/// For which page a plot is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// A desktop.
    Wide,
    /// A phone.
    Narrow,
}

impl Width {
    /// Nominal size in px: width, height of the speeds, height of the errors.
    pub(super) fn size(self) -> (u32, u32, u32) {
        match self {
            Width::Wide => (980, 250, 190),
            Width::Narrow => (470, 240, 190),
        }
    }

    /// Labels of a horizontal axis at most.
    pub(super) fn labels(self) -> usize {
        match self {
            Width::Wide => 10,
            Width::Narrow => 5,
        }
    }

    pub(super) fn class(self) -> &'static str {
        match self {
            Width::Wide => "wide",
            Width::Narrow => "narrow",
        }
    }
}

/// Returns the style rules that give every colour of the plots its variable.
pub fn colour_rules() -> String {
    let mut rules = String::new();
    for (RGBColor(r, g, b), variable) in INKS {
        for property in ["fill", "stroke"] {
            // Writing to a string cannot fail.
            let _ = writeln!(
                rules,
                "svg.plot [{property}=\"#{r:02X}{g:02X}{b:02X}\"]{{{property}:var({variable})}}"
            );
        }
    }
    rules
}

/// Returns a picture of a nominal size in px for the page: it takes its size from the page, and states its subject and
/// the places of its charts; `paint` draws the charts and returns their frames.
pub(super) fn picture(
    label: &str,
    class: &str,
    (width, height): (u32, u32),
    paint: impl FnOnce(&Area<'_>) -> Result<Vec<Frame>, DrawError>,
) -> Result<String, PlotError> {
    let (width, height) = (width * SCALE, height * SCALE);
    let mut drawing = String::new();
    let painted = {
        let area = SVGBackend::with_string(&mut drawing, (width, height)).into_drawing_area();
        paint(&area).and_then(|frames| area.present().map(|()| frames))
    };
    let frames = painted.map_err(|source| PlotError { plot: label.into(), source })?;
    let body = drawing.find('>').map_or("", |end| &drawing[end + 1..]);
    // An opaque colour need not say so.
    let body = body.replace(" opacity=\"1\"", "");
    let frames = if frames.is_empty() {
        String::new()
    } else {
        format!(" data-frames=\"{}\"", json!(frames))
    };
    Ok(format!(
        "<svg class=\"plot {class}\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         aria-label=\"{}\"{frames}>{body}",
        escape(label)
    ))
}

/// Returns a plot for wide pages and one for narrow ones.
///
/// # Errors
///
/// When one cannot be drawn.
pub fn wide_and_narrow<T>(
    draw: impl Fn(Width) -> Result<T, PlotError>,
) -> Result<[T; 2], PlotError> {
    Ok([draw(Width::Wide)?, draw(Width::Narrow)?])
}

/// Returns a plot, or one for wide and one for narrow pages, that answers to the pointer; caption and key
/// are HTML.
pub fn figure(class: &str, caption: &str, key: &str, plots: &[Plot]) -> String {
    let readings = plots.first().map_or(String::new(), |plot| reading::json(&plot.readings));
    let svg: String = plots.iter().map(|plot| &plot.svg[..]).collect();
    format!(
        "<figure class=\"{class}\" data-readings=\"{}\">\n<figcaption>{caption}</figcaption>\n\
         {key}{svg}</figure>\n",
        escape(&readings)
    )
}

/// Makes a plot of the page a file of its own: at its nominal size, on white.
pub fn as_file(plot: &str) -> String {
    let size: Vec<u32> = plot
        .split_once("viewBox=\"0 0 ")
        .and_then(|(_, rest)| rest.split_once('"'))
        .map_or(Vec::new(), |(size, _)| size.split(' ').filter_map(|px| px.parse().ok()).collect());
    let (Some(width), Some(height)) = (size.first(), size.get(1)) else { return plot.into() };
    let (head, body) = plot.split_once('>').unwrap_or((plot, ""));
    format!(
        "{head} xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>{body}\n",
        width / SCALE,
        height / SCALE
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_its_own_has_a_size_a_name_space_and_a_ground() {
        let plot = picture("a", "wide", (400, 300), |_| Ok(Vec::new())).unwrap();
        let file = as_file(&plot);
        assert!(file.contains("viewBox=\"0 0 800 600\""), "{file}");
        assert!(
            file.contains(" xmlns=\"http://www.w3.org/2000/svg\" width=\"400\" height=\"300\">")
        );
        let ground = "<rect width=\"800\" height=\"600\" fill=\"#FFFFFF\"/>\n</svg>\n";
        assert!(file.contains(ground), "{file}");
    }

    #[test]
    fn every_colour_has_a_rule_of_its_own() {
        let rules = colour_rules();
        assert_eq!(rules.lines().count(), 2 * INKS.len());
        for (k, ink) in INKS.iter().enumerate() {
            assert!(INKS[..k].iter().all(|other| other.0 != ink.0));
        }
        assert!(rules.contains("svg.plot [fill=\"#B85C14\"]{fill:var(--before)}"));
    }

    #[test]
    fn a_drawing_for_the_page_has_no_size_of_its_own() {
        let svg = picture("a \"b\"", "wide", (4, 3), |_| Ok(vec![[1.5; 7]])).unwrap();
        assert!(svg.starts_with("<svg class=\"plot wide\" viewBox=\"0 0 8 6\" role=\"img\""));
        assert!(
            svg.contains("aria-label=\"a &quot;b&quot;\"") && svg.trim_end().ends_with("</svg>")
        );
        assert!(svg.contains("data-frames=\"[[1.5,1.5,"), "{svg}");
    }
}
