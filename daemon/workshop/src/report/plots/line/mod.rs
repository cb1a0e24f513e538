//! A line over its chainage: its declared properties (height, gradient, curves, permitted speed, with tunnels and
//! stops), and below them the effects found.

mod panels;

use dynocar_analysis::explain::report::residual_line::AlongLine;
use dynocar_model::track::Track;
use plotters::element::{PathElement, Text};
use plotters::style::text_anchor::{HPos, VPos};

use super::axes::{Axis, Chart, band, chart, frame, letters, padded, shade, stroke, zero_line};
use super::panel::means;

use super::picture::{
    ACTING, AFTER, AXIS, Area, DrawError, Plot, PlotError, SCALE, TUNNEL, Width, picture,
};
use panels::{Content, Panel};

/// Nominal width in px of a letter of a stop's name, and of the gap to the next name.
const LETTER_PX: f64 = 7.0;
const GAP_PX: f64 = 10.0;

/// Contents of every panel.
struct Ground<'a> {
    track: Option<&'a Track>,
    found: &'a AlongLine,
    has_effect: bool,
    width: Width,
    /// The chainage in km.
    x: [f64; 2],
}

/// Returns the line as a plot; `None` where nothing of it is known that could be drawn.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(
    track: Option<&Track>,
    found: &AlongLine,
    has_effect: bool,
    width: Width,
) -> Result<Option<Plot>, PlotError> {
    let declared_m = track.and_then(panels::ends_m);
    let driven = found.residual.iter().flat_map(|it| it.1.iter().map(|bin| 1e3 * bin.at));
    let ends_m = padded(declared_m.into_iter().flatten().chain(driven), 0.0);
    let mut panels = panels::found(found);
    if let (Some(track), Some(_)) = (track, declared_m) {
        panels.splice(0..0, panels::declared(track, ends_m));
    }
    if panels.is_empty() {
        return Ok(None);
    }
    let x = padded(ends_m.into_iter().map(|at_m| at_m / 1e3), 0.005);
    let ground = Ground { track, found, has_effect, width, x };
    let mut bottoms = Vec::new();
    let mut height = 0;
    for panel in &panels {
        height += panel.height();
        bottoms.push((height * SCALE) as i32);
    }
    let size = (width.size().0, height);
    let svg = picture(&ground.label(&panels), width.class(), size, |whole| {
        let areas = whole.split_by_breakpoints([0; 0], &bottoms[..bottoms.len() - 1]);
        let drawn = panels.iter().zip(&areas).enumerate().map(|(index, (panel, area))| {
            let (is_first, is_last) = (index == 0, index + 1 == panels.len());
            Ok(frame(&ground.draw(panel, area, is_first, is_last)?))
        });
        drawn.collect()
    })?;
    let readings = panels.iter().map(|panel| panel.reading(has_effect)).collect();
    Ok(Some(Plot { svg, readings }))
}

impl Ground<'_> {
    fn draw<'a, 't>(
        &self,
        panel: &Panel,
        area: &'a Area<'t>,
        is_first: bool,
        is_last: bool,
    ) -> Result<Chart<'a, 't>, DrawError> {
        let (x, y) = (self.x, panel.range(self.has_effect));
        let below = if is_last { self.x_title() } else { String::new() };
        let labels = self.width.labels();
        let x_axis = Axis { range: x, title: &below, labels, is_whole: false };
        let is_lane = matches!(panel.content, Content::Places(_));
        let (title, labels) = (panel.title(), if is_lane { 0 } else { 5 });
        let y_axis = Axis { range: y, title: &title, labels, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        let (colour, ranges_m): (_, Vec<[f64; 2]>) = match &panel.content {
            Content::Line { .. } => {
                let tunnels = self.track.map_or(&[][..], Track::tunnels).iter();
                (TUNNEL, tunnels.map(|it| [it.start_m, it.end_m]).collect())
            }
            Content::Places(_) => (ACTING, Vec::new()),
            Content::Means(..) => {
                let found = self.found.places.iter().flat_map(|place| &place.sections);
                (ACTING, found.filter(|it| it.run.is_none()).map(|it| it.at_m).collect())
            }
        };
        let ranges: Vec<[f64; 2]> = ranges_m.iter().map(|it| it.map(|at_m| at_m / 1e3)).collect();
        shade(&mut chart, colour, &ranges)?;
        if let Content::Line { points, halves } = &panel.content
            && !halves.is_empty()
        {
            band(&mut chart, points, halves)?;
        }
        if !is_lane {
            zero_line(&mut chart)?;
        }
        self.stops(&mut chart, y, is_first)?;
        match &panel.content {
            Content::Line { points, .. } => {
                let line = PathElement::new(points.clone(), stroke(AFTER, 1.4));
                chart.draw_series([line])?;
            }
            Content::Places(sections) => panels::bars(&mut chart, sections, x[0])?,
            Content::Means(_, bins) => means(&mut chart, bins, self.has_effect, x)?,
        }
        Ok(chart)
    }

    /// A line at each stop and, where there is room, its name above.
    fn stops(&self, chart: &mut Chart, y: [f64; 2], has_names: bool) -> Result<(), DrawError> {
        let km_per_px = (self.x[1] - self.x[0]) / f64::from(self.width.size().0);
        let mut free_km = f64::NEG_INFINITY;
        for (at_m, name) in self.track.iter().flat_map(|track| &track.survey.stops) {
            let at_km = at_m / 1e3;
            let line = vec![(at_km, y[0]), (at_km, y[1])];
            chart.draw_series([PathElement::new(line, stroke(AXIS, 0.6))])?;
            let width_km = km_per_px * (LETTER_PX * name.chars().count() as f64 + GAP_PX);
            if !has_names || name.is_empty() || at_km < free_km {
                continue;
            }
            // The last name ends at its stop.
            let fits = at_km + width_km <= self.x[1];
            if !fits && at_km - width_km < free_km {
                continue;
            }
            let side = if fits { HPos::Left } else { HPos::Right };
            let text = if fits { format!(" {name}") } else { format!("{name} ") };
            chart.draw_series([Text::new(text, (at_km, y[1]), letters((side, VPos::Top)))])?;
            free_km = at_km + width_km;
        }
        Ok(())
    }

    fn x_title(&self) -> String {
        let mut title = String::from("Chainage, km");
        if self.track.is_some_and(|track| !track.survey.stops.is_empty()) {
            title += "; upright lines: stops";
        }
        if self.track.is_some_and(|track| !track.tunnels().is_empty()) {
            title += "; grey: tunnels";
        }
        title
    }

    fn label(&self, panels: &[Panel]) -> String {
        let described: Vec<String> = panels.iter().map(Panel::described).collect();
        let (name, stops, tunnels) = self.track.map_or(("", 0, 0), |track| {
            (&track.name[..], track.survey.stops.len(), track.tunnels().len())
        });
        let line = format!("The line {name} over its chainage");
        format!("{line}: {}; {stops} stops, {tunnels} tunnels", described.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_analysis::dataset::parse_track;
    use dynocar_analysis::explain::report::panels::PanelBin;
    use dynocar_analysis::explain::report::residual_line::{FoundPlace, MarkedInterval};

    const LINE: &str = "[track]\nname = \"A & B\"\nlength_m = 2000\n\
        gradient = [[0, 10.0], [1000, -5.0]]\ncurves = [[500, 700, 400]]\n\
        tunnels = [[1200, 1400]]\nstops = [[0, \"A\"], [10, \"hidden\"], [2000, \"B\"]]\n\
        permitted_speed = [[0, 20], [800, 30]]\n";

    fn drawn(track: &Track) -> Option<Plot> {
        draw(Some(track), &AlongLine::default(), false, Width::Wide).unwrap()
    }

    #[test]
    fn what_was_found_is_drawn_below_what_is_declared() {
        let track = parse_track("track.toml", LINE).unwrap();
        let bin = |at: f64| PanelBin {
            at,
            count: 4,
            before_n_per_kn: (0.5, 0.1),
            after_n_per_kn: (0.0, 0.1),
            effect_n_per_kn: (0.5, 0.1),
        };
        let ends_m = [Some([250.0, 350.0]), None];
        let found = AlongLine {
            residual: vec![(1.0, vec![bin(0.2), bin(1.6)]), (-1.0, vec![bin(0.4), bin(1.8)])],
            places: vec![FoundPlace {
                name: "a local resistance".into(),
                sections: vec![
                    MarkedInterval { at_m: [300.0, 600.0], run: None, ends_m },
                    MarkedInterval {
                        at_m: [300.0, 400.0],
                        run: Some("7.csv".into()),
                        ends_m: [None; 2],
                    },
                ],
            }],
            gradient_error: vec![[0.0, 1.0, 0.5], [2000.0, -1.0, 0.5]],
        };
        for width in [Width::Wide, Width::Narrow] {
            let plot = draw(Some(&track), &found, true, width).unwrap().expect("a plot");
            for words in [
                "Found: a local resistance",
                "Error of the gradient, found, ‰",
                "Missing resistance, growing chainage, N/kN",
                "Missing resistance, falling chainage, N/kN",
                "Found: a local resistance from km 0.30 to 0.60, from km 0.30 to 0.40 in 7.csv; ",
                "\u{2002}7.csv\n",
                "falling chainage: at most 0.50 N/kN; 3 stops",
            ] {
                assert!(plot.svg.contains(words), "{words}");
            }
            assert_eq!(plot.svg.matches("<circle").count(), 8, "both sides of every mean");
            assert_eq!(plot.readings.len(), 8);
            assert_eq!(plot.readings[5].series[0].halves, [0.5, 0.5]);
            assert_eq!(plot.readings[7].at, [0.4, 1.8]);
        }
        let alone = draw(None, &found, true, Width::Wide).unwrap().expect("a plot");
        assert_eq!(alone.readings.len(), 4);
    }

    #[test]
    fn a_line_is_drawn_with_all_that_is_known_of_it() {
        let track = parse_track("track.toml", LINE).unwrap();
        let svg = drawn(&track).expect("something to draw").svg;
        for words in [
            "Height above the start, m",
            "Gradient, ‰",
            "Curvature 1/R, 1/km",
            "Permitted speed, km/h",
            "Chainage, km; upright lines: stops; grey: tunnels",
            "The line A &amp; B over its chainage: Height above the start, m from 0.0 to 10.0",
            "Gradient, ‰ from -5.0 to 10.0; Curvature 1/R, 1/km from 0.0 to 2.5",
            "Permitted speed, km/h from 72.0 to 108.0; 3 stops, 1 tunnels",
        ] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("hidden"), "two names would overlap");
        assert!(svg.contains("fill=\"#E2E3E7\""), "tunnels are grey");
        let joined = LINE.replace("[[500, 700, 400]]", "[[500, 600, 1000], [600, 700, 500]]");
        let track = parse_track("track.toml", &joined).unwrap();
        let corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.6, 1.0), (0.6, 2.0), (0.7, 2.0)];
        let rest = [(0.7, 0.0), (2.0, 0.0)];
        assert_eq!(panels::curvature(&track, [0.0, 2000.0]), [&corners[..], &rest].concat());
    }

    #[test]
    fn only_what_is_known_is_drawn() {
        let drawn = |text: &str| drawn(&parse_track("track.toml", text).unwrap()).map(|it| it.svg);
        assert_eq!(drawn("[track]\n"), None);
        assert_eq!(drawn("[track]\ntunnels = [[0, 5]]\n"), None);
        let svg = drawn("[track]\ncurves = []\nstops = [[0, \"\"], [900, \"\"]]\n").unwrap();
        assert!(svg.contains("Curvature") && !svg.contains("Gradient"));
        assert!(drawn("[track]\ngradient = [[0, 3]]\n").unwrap().contains("Gradient"));
    }
}
