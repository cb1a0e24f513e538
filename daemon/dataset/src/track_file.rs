//! `track.toml`.

use dynocar_model::terms::{gradient, masses, place};
use dynocar_model::track::{
    Curve, GradientError, LinearProfile, MassSection, ProfileError, StepProfile, Track, TrackError,
    TrackSurvey, Tunnel,
};

use super::document::{Document, Section};
use super::error::{DatasetError, Problem, SourcePosition};

/// A steeper gradient in ‰ than any adhesion railway has is a mistake of unit.
const GRADIENT_MAX_PERMILLE: f64 = 150.0;
/// How a line is called that nobody named.
const UNNAMED: &str = "unnamed line";

/// Reads the text of a `track.toml`; `label` names the file in messages.
///
/// # Errors
///
/// Names file, line, key, value and what was allowed. Unknown keys are refused.
pub fn parse_track(label: &str, text: &str) -> Result<Track, DatasetError> {
    let document = Document::parse(label, text)?;
    let root = document.root();
    root.allow(&["track"])?;
    let Some(section) = root.table("track")? else {
        let unknown = Track::new(UNNAMED.into(), None, None, None, None);
        return unknown
            .map_err(|error| SourcePosition::whole(label).problem(Problem::Track(error)));
    };
    section.allow(&[
        "name",
        "length_m",
        "gradient",
        gradient::SHIFT,
        gradient::ERROR,
        gradient::ERROR_FALLING,
        "curves",
        "tunnels",
        place::LIST,
        masses::LIST,
        "gradient_falling",
        "gradient_std",
        "stops",
        "permitted_speed",
        "alignment",
        "alignment_falling",
    ])?;
    let length_m = section.number("length_m", "a length in m above 0", |length| length > 0.0)?;
    let gradient = profile(&section, "gradient", -GRADIENT_MAX_PERMILLE)?;
    let (gradient, gradient_places) = gradient.unzip();
    let curves = section.entries::<3>("curves", "[start_m, end_m, radius_m]")?.map(split);
    let (curves, curve_places) = curves.unzip();
    let tunnels = section.entries::<2>("tunnels", "[start_m, end_m]")?.map(split);
    let (tunnels, tunnel_places) = tunnels.unzip();
    let to_curve = |&[start_m, end_m, radius_m]: &[f64; 3]| Curve { start_m, end_m, radius_m };
    let to_tunnel = |&[start_m, end_m]: &[f64; 2]| Tunnel { start_m, end_m };
    let curves: Option<Vec<Curve>> = curves.map(|list: Vec<_>| list.iter().map(to_curve).collect());
    let tunnels: Option<Vec<Tunnel>> =
        tunnels.map(|list: Vec<_>| list.iter().map(to_tunnel).collect());
    let starts = Starts {
        curves: curves.iter().flatten().map(|curve| curve.start_m).collect(),
        tunnels: tunnels.iter().flatten().map(|tunnel| tunnel.start_m).collect(),
    };
    let places = Places {
        gradient: gradient_places.unwrap_or_default(),
        curves: curve_places.unwrap_or_default(),
        tunnels: tunnel_places.unwrap_or_default(),
    };
    let name = section.text("name")?.unwrap_or(UNNAMED).into();
    let refused = |error| Err(places.of(&error, &starts, &section).problem(Problem::Track(error)));
    let track = match Track::new(name, length_m, gradient.as_deref(), curves, tunnels) {
        Ok(track) => track,
        Err(error) => return refused(error),
    };
    with_survey(with_corrections(track, &section)?, &section)
}

/// Adds what a survey knows besides the profile.
fn with_survey(mut track: Track, section: &Section) -> Result<Track, DatasetError> {
    let profile = |key: &str, low: f64| -> Result<Option<StepProfile>, DatasetError> {
        let Some((list, places)) = profile(section, key, low)? else { return Ok(None) };
        let made = StepProfile::new(&list).map_err(|error| {
            let index = match error {
                ProfileError::Empty => None,
                ProfileError::NotFinite { index, .. }
                | ProfileError::NotIncreasing { index, .. } => places.get(index - 1).cloned(),
            };
            let place = index.unwrap_or_else(|| section.place_of(key));
            place.problem(Problem::Track(TrackError::Gradient(error)))
        })?;
        Ok(Some(made))
    };
    track.survey = TrackSurvey {
        gradient_falling: profile("gradient_falling", -GRADIENT_MAX_PERMILLE)?,
        gradient_std_permille: profile("gradient_std", 0.0)?,
        stops: section.named_chainages("stops")?,
        permitted_speed_mps: permitted_speed(section)?,
        alignment: section.text("alignment")?.map(Into::into),
        alignment_falling: section.text("alignment_falling")?.map(Into::into),
    };
    Ok(track)
}

/// The list of [chainage_m, speed_mps] under `permitted_speed`.
fn permitted_speed(section: &Section) -> Result<Option<StepProfile>, DatasetError> {
    const KEY: &str = "permitted_speed";
    let Some(entries) = section.entries::<2>(KEY, "[chainage_m, speed_mps]")? else {
        return Ok(None);
    };
    for (index, ([_, speed_mps], place)) in entries.iter().enumerate() {
        if !(*speed_mps > 0.0 && *speed_mps <= 200.0) {
            let key = format!("{} entry {}", section.full(KEY), index + 1);
            let (value, allowed) =
                (speed_mps.to_string(), "a speed in m/s above 0, at most 200".into());
            return Err(place.clone().problem(Problem::OutOfRange { key, value, allowed }));
        }
    }
    let list: Vec<(f64, f64)> =
        entries.into_iter().map(|([at_m, speed], _)| (at_m, speed)).collect();
    let made = StepProfile::new(&list).map_err(|error| {
        section.place_of(KEY).problem(Problem::Track(TrackError::PermittedSpeed(error)))
    })?;
    Ok(Some(made))
}

/// Adds what measured runs have shown of the line: resistance at places, other masses in sections.
fn with_corrections(mut track: Track, section: &Section) -> Result<Track, DatasetError> {
    const RESISTANCE: &str = "[start_m, end_m, extra N/kN]";
    let shift = "a shift in m from -10000 to 10000";
    let is_shift = |shift_m: f64| shift_m.abs() <= 1e4;
    if let Some(shift_m) = section.number(gradient::SHIFT, shift, is_shift)? {
        track.gradient_shift_m = shift_m;
    }
    let falling = gradient_error(section, gradient::ERROR_FALLING)?;
    match (gradient_error(section, gradient::ERROR)?, falling) {
        (Some(profile), falling) => {
            track.gradient_error = Some(GradientError { profile, falling });
        }
        (None, Some(_)) => {
            let key = section.full(gradient::ERROR_FALLING);
            let value = "without gradient_error".to_string();
            let allowed = "the list gradient_error with it, for growing chainage".to_string();
            let problem = Problem::OutOfRange { key, value, allowed };
            return Err(section.place_of(gradient::ERROR_FALLING).problem(problem));
        }
        (None, None) => {}
    }
    if let Some(entries) = section.entries::<3>(place::LIST, RESISTANCE)? {
        let places: Vec<_> =
            entries.iter().map(|([start_m, end_m, extra], _)| (*start_m, *end_m, *extra)).collect();
        track = track
            .with_resistance(&places)
            .map_err(|error| section.place_of(place::LIST).problem(Problem::Track(error)))?;
    }
    const MASSES: &str = "[from_m, to_m, direction (1 or -1), mass factor]";
    if let Some(entries) = section.entries::<4>(masses::LIST, MASSES)? {
        let mut sections = Vec::with_capacity(entries.len());
        for (index, ([from_m, to_m, direction, mass_factor], place)) in
            entries.into_iter().enumerate()
        {
            let is_sound =
                from_m < to_m && direction.abs() == 1.0 && (0.1..=10.0).contains(&mass_factor);
            if !is_sound {
                let key = format!("{} entry {}", section.full(masses::LIST), index + 1);
                let value = format!("[{from_m}, {to_m}, {direction}, {mass_factor}]");
                let allowed = "from_m < to_m, direction 1 or -1, a factor from 0.1 to 10".into();
                return Err(place.problem(Problem::OutOfRange { key, value, allowed }));
            }
            sections.push(MassSection { from_m, to_m, direction, mass_factor });
        }
        track.masses = sections;
    }
    Ok(track)
}

/// What the declared gradient lacks, in one of its lists.
fn gradient_error(
    section: &Section,
    name: &'static str,
) -> Result<Option<LinearProfile>, DatasetError> {
    let Some(entries) = section.entries::<2>(name, "[chainage_m, permille]")? else {
        return Ok(None);
    };
    let entries = entries.into_iter().map(|([at_m, permille], _)| (at_m, permille)).collect();
    let refused =
        |error| section.place_of(name).problem(Problem::Track(TrackError::Gradient(error)));
    LinearProfile::new(entries).map(Some).map_err(refused)
}

/// Where the entries of the lists stand.
struct Places {
    gradient: Vec<SourcePosition>,
    curves: Vec<SourcePosition>,
    tunnels: Vec<SourcePosition>,
}

/// Where the intervals start, in the order of the file.
struct Starts {
    curves: Vec<f64>,
    tunnels: Vec<f64>,
}

impl Places {
    /// The place of the entry that an error means.
    fn of(&self, error: &TrackError, starts: &Starts, section: &Section) -> SourcePosition {
        let (list, index) = match error {
            TrackError::Gradient(ProfileError::Empty) => return section.place_of("gradient"),
            TrackError::Gradient(
                ProfileError::NotFinite { index, .. } | ProfileError::NotIncreasing { index, .. },
            ) => (&self.gradient, *index),
            TrackError::PermittedSpeed(_) => return section.place_of("permitted_speed"),
            TrackError::BadRadius { index, .. } => (&self.curves, *index),
            TrackError::BadInterval { list, index, .. } => (self.list(list), *index),
            TrackError::Overlap { list, index, .. } => {
                let starts = if *list == "tunnels" { &starts.tunnels } else { &starts.curves };
                // The error counts by chainage; the file may be in another order.
                let mut order: Vec<usize> = (0..starts.len()).collect();
                order.sort_by(|&one, &other| starts[one].total_cmp(&starts[other]));
                (self.list(list), order.get(index - 1).map_or(*index, |entry| entry + 1))
            }
        };
        list.get(index - 1).cloned().unwrap_or_else(|| section.place())
    }

    fn list(&self, list: &str) -> &Vec<SourcePosition> {
        if list == "tunnels" { &self.tunnels } else { &self.curves }
    }
}

fn split<const N: usize>(
    entries: Vec<([f64; N], SourcePosition)>,
) -> (Vec<[f64; N]>, Vec<SourcePosition>) {
    entries.into_iter().unzip()
}

type Gradient = (Vec<(f64, f64)>, Vec<SourcePosition>);

/// A list of [chainage_m, permille] with values from `low` to the steepest gradient.
fn profile(section: &Section, key: &str, low: f64) -> Result<Option<Gradient>, DatasetError> {
    let Some(entries) = section.entries::<2>(key, "[chainage_m, permille]")? else {
        return Ok(None);
    };
    for (index, ([_, permille], place)) in entries.iter().enumerate() {
        if !(low..=GRADIENT_MAX_PERMILLE).contains(permille) {
            let key = format!("{} entry {}", section.full(key), index + 1);
            let allowed = format!("from {low} to {GRADIENT_MAX_PERMILLE} permille");
            let value = permille.to_string();
            return Err(place.clone().problem(Problem::OutOfRange { key, value, allowed }));
        }
    }
    let (list, places) = split(entries);
    Ok(Some((
        list.into_iter().map(|[chainage_m, permille]| (chainage_m, permille)).collect(),
        places,
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: &str = "[track]
name = \"line\"
length_m = 3000
gradient = [
  [0, 3.0],
  [1200.0, -2.5],
]
curves = [
  [1000.0, 1600.0, 800.0],
  [200.0, 300.0, 500.0],
]
tunnels = [[2200.0, 2900.0]]
";

    fn refusal(text: &str) -> String {
        parse_track("track.toml", text).unwrap_err().to_string()
    }

    #[test]
    fn every_list_is_read() {
        let track = parse_track("track.toml", FULL).unwrap();
        assert_eq!((track.name.as_str(), track.length_m), ("line", Some(3000.0)));
        assert_eq!(track.gradient_permille(1300.0, 0.0), Some(-2.5));
        assert_eq!(track.curves().len(), 2);
        assert_eq!(track.tunnels(), [Tunnel { start_m: 2200.0, end_m: 2900.0 }]);
    }

    #[test]
    fn an_absent_list_is_unknown_and_an_empty_one_is_none_there() {
        let track = parse_track("track.toml", "[track]\ntunnels = []\n").unwrap();
        assert!(track.knows_tunnels() && !track.knows_curves());
        assert_eq!(track.gradient(), None);
        let (absent, empty) =
            (parse_track("track.toml", ""), parse_track("track.toml", "[track]\n"));
        assert_eq!(absent, empty);
        assert!(absent.is_ok_and(|track| !track.knows_tunnels() && track.gradient().is_none()));
    }

    #[test]
    fn what_a_survey_adds_is_read() {
        let text = FULL.to_string()
            + "gradient_falling = [[0.0, 1.5]]\ngradient_std = [[0.0, 0.4]]\n\
               stops = [[120.0, \"Depot\"], [2900, \"\"]]\nalignment = \"alignment.csv\"\n\
               permitted_speed = [[0.0, 22.5], [1500, 11]]\n";
        let track = parse_track("track.toml", &text).unwrap();
        assert_eq!(track.gradient_towards_permille(-1.0, 1300.0, 0.0), Some(1.5));
        let survey = &track.survey;
        assert_eq!(survey.stops, [(120.0, "Depot".into()), (2900.0, String::new())]);
        assert_eq!(survey.alignment.as_deref(), Some("alignment.csv"));
        let permitted = survey.permitted_speed_mps.as_ref().map(|it| it.value_at(1600.0));
        assert_eq!(permitted, Some(11.0));
        assert_eq!(
            refusal(&text.replace("[1500, 11]", "[1500, 0]")),
            "track.toml:17: track.permitted_speed entry 2 = 0: expected a speed in m/s above 0, at \
             most 200"
        );
        assert_eq!(
            refusal(&text.replace("[1500, 11]", "[0, 11]")),
            "track.toml:17: permitted_speed: entry 2: expected a chainage above the one before (0 m), \
             got 0 m"
        );
        assert_eq!(
            refusal(&text.replace("[[0.0, 0.4]]", "[[0.0, -0.4]]")),
            "track.toml:14: track.gradient_std entry 1 = -0.4: expected from 0 to 150 permille"
        );
        assert_eq!(
            refusal(&text.replace("[2900, \"\"]", "[2900]")),
            "track.toml:15: track.stops entry 2: expected [chainage_m, \"name\"], got [2900]"
        );
    }

    #[test]
    fn the_line_of_a_bad_entry_is_named() {
        let cases = [
            (
                ("[1200.0, -2.5]", "[0.0, -2.5]"),
                "track.toml:6: gradient: entry 2: expected a chainage above the one before (0 m), \
                 got 0 m",
            ),
            (
                ("[1200.0, -2.5]", "[1200.0, -250]"),
                "track.toml:6: track.gradient entry 2 = -250: expected from -150 to 150 permille",
            ),
            (
                ("[1200.0, -2.5]", "[1200.0]"),
                "track.toml:6: track.gradient entry 2: expected [chainage_m, permille], finite \
                 numbers, got [1200.0]",
            ),
            (
                ("[200.0, 300.0, 500.0]", "[200.0, 100.0, 500.0]"),
                "track.toml:10: curves entry 2: expected start < end, both within a million km, got \
                 200 m to 100 m",
            ),
            (
                ("[200.0, 300.0, 500.0]", "[200.0, 1300.0, 500.0]"),
                "track.toml:9: curves entry 2 starts at 1000 m, inside the one that ends at 1300 m",
            ),
            (
                ("[200.0, 300.0, 500.0]", "[200.0, 300.0, 0]"),
                "track.toml:10: curves entry 2: expected a radius above 0 m, got 0 m",
            ),
            (
                ("length_m = 3000", "length_m = 0"),
                "track.toml:3: track.length_m = 0: expected a length in m above 0",
            ),
            (
                ("tunnels", "tunnel"),
                "track.toml:12: unknown key 'tunnel' in [track]; did you mean 'tunnels'? \
                 (choices: 'name', 'length_m', 'gradient', 'gradient_shift_m', 'gradient_error', \
                 'gradient_error_falling', 'curves', 'tunnels', 'resistance', 'masses', 'gradient_falling', 'gradient_std', \
                 'stops', 'permitted_speed', 'alignment', 'alignment_falling')",
            ),
        ];
        for ((from, to), expected) in cases {
            assert_eq!(refusal(&FULL.replace(from, to)), expected);
        }
        assert_eq!(
            refusal("[track]\ngradient = []\n"),
            "track.toml:2: gradient: expected at least one entry, got none"
        );
    }
}
