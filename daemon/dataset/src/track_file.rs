//! Reader of `track.toml`.

use dynocar_model::track::{
    GradientError, IntervalValue, LinearProfile, MassSection, ProfileError, StepProfile, Track,
    TrackCurve, TrackError, TrackSurvey, Tunnel,
};
use dynocar_model::train::NumberRule;

use super::document::{Entries, Item};
use super::error::{DatasetError, SourcePosition};
use super::keys::track::{
    ALIGNMENT, ALIGNMENT_FALLING, CURVES, GRADIENT, GRADIENT_ERROR, GRADIENT_ERROR_FALLING,
    GRADIENT_FALLING, GRADIENT_SHIFT, GRADIENT_STD, KEYS, LENGTH, MASSES, NAME, PERMITTED_SPEED,
    RESISTANCE, STOPS, TABLE, TUNNELS,
};
use super::keys::{FileKey, allow};
use super::node::Node;

/// Range of gradients: a steeper one than on any adhesion railway is a mistake of the unit.
const GRADIENTS: NumberRule = NumberRule::within(-150.0, 150.0, "from -150 to 150 permille");
const GRADIENT_STDS: NumberRule = NumberRule::within(0.0, 150.0, "from 0 to 150 permille");
const SPEEDS: NumberRule = NumberRule::above(0.0, 200.0, "a speed in m/s above 0, at most 200");
/// Name of a line that nobody named.
const UNNAMED: &str = "unnamed line";

/// Reads the text of a `track.toml`; `label` names the file in messages.
///
/// # Errors
///
/// Names file, line, key, value and the allowed values. Unknown keys are refused.
pub fn parse_track(label: &str, text: &str) -> Result<Track, DatasetError> {
    let document = Node::of_toml(label, text)?;
    let root = Item::root(label, &document);
    root.allow(&[TABLE])?;
    let Some(section) = root.table(TABLE)? else {
        let unknown = Track::new(UNNAMED.into(), None, None, None, None);
        return unknown.map_err(|error| root.wrong(error));
    };
    allow(&section, KEYS)?;
    let length_m = LENGTH.number(&section)?;
    let gradient = pairs(&section, &GRADIENT, &GRADIENTS)?;
    let curves = CURVES.entries::<3>(&section)?;
    let tunnels = TUNNELS.entries::<2>(&section)?;
    let name = NAME.quoted(&section)?.unwrap_or(UNNAMED).into();
    let profile = gradient.as_ref().map(|(list, _)| &list[..]);
    let to_curve =
        |&([start_m, end_m, radius_m], _): &([f64; 3], _)| TrackCurve { start_m, end_m, radius_m };
    let to_tunnel = |&([start_m, end_m], _): &([f64; 2], _)| Tunnel { start_m, end_m };
    let of_curves = curves.as_ref().map(|list| list.iter().map(to_curve).collect());
    let of_tunnels = tunnels.as_ref().map(|list| list.iter().map(to_tunnel).collect());
    let track = Track::new(name, length_m, profile, of_curves, of_tunnels).map_err(|error| {
        let gradient = gradient.map_or_else(Vec::new, |(_, entries)| entries);
        let starts = [
            (GRADIENT.name, gradient),
            (CURVES.name, placed(curves)),
            (TUNNELS.name, placed(tunnels)),
        ];
        place_of(&error, &starts, &section).problem(error)
    })?;
    with_survey(with_corrections(track, &section)?, &section)
}

/// Entries of a list by their first number, a chainage in m.
type Placed<'t> = Vec<(f64, Item<'t>)>;

fn placed<const N: usize>(entries: Option<Entries<N>>) -> Placed {
    entries.into_iter().flatten().map(|(numbers, entry)| (numbers[0], entry)).collect()
}

/// Where the entry stands that an error means.
fn place_of(error: &TrackError, lists: &[(&str, Placed); 3], section: &Item) -> SourcePosition {
    let entries = |name: &str| lists.iter().find(|(list, _)| *list == name).map(|(_, it)| &it[..]);
    let (name, index) = match error {
        TrackError::Gradient(error) => (GRADIENT.name, index_of(error)),
        TrackError::PermittedSpeed(error) => (PERMITTED_SPEED.name, index_of(error)),
        TrackError::BadRadius { index, .. } => (CURVES.name, Some(*index)),
        TrackError::BadInterval { list, index, .. } => (*list, Some(*index)),
        TrackError::Overlap { list, index, .. } => {
            // The error counts by chainage; the file may be in another order.
            let starts = entries(list).unwrap_or_default();
            let mut order: Vec<usize> = (0..starts.len()).collect();
            order.sort_by(|&one, &other| starts[one].0.total_cmp(&starts[other].0));
            (*list, order.get(index - 1).map(|entry| entry + 1))
        }
    };
    let entry = index.and_then(|index| entries(name)?.get(index - 1));
    entry.map_or_else(|| section.place_of(name), |(_, entry)| entry.place())
}

/// Returns the number of the entry, from 1, that an error of a profile means.
fn index_of(error: &ProfileError) -> Option<usize> {
    match error {
        ProfileError::Empty => None,
        ProfileError::NotFinite { index, .. } | ProfileError::NotIncreasing { index, .. } => {
            Some(*index)
        }
    }
}

/// Returns a list of pairs of chainage in m and an allowed value, with the place of each.
#[expect(clippy::type_complexity, reason = "a list and its places, taken apart at once")]
fn pairs<'t>(
    section: &Item<'t>,
    key: &FileKey,
    rule: &NumberRule,
) -> Result<Option<(Vec<(f64, f64)>, Placed<'t>)>, DatasetError> {
    let Some(entries) = key.entries::<2>(section)? else { return Ok(None) };
    let entries = entries
        .into_iter()
        .map(|([at_m, value], entry)| Ok(((at_m, entry.within(value, rule)?), (at_m, entry))));
    entries.collect::<Result<_, DatasetError>>().map(Some)
}

/// Adds the results of a survey other than the profile.
fn with_survey(mut track: Track, section: &Item) -> Result<Track, DatasetError> {
    type Wrap = fn(ProfileError) -> TrackError;
    let profile = |key: &FileKey, rule: &NumberRule, wrap: Wrap| {
        let Some((list, entries)) = pairs(section, key, rule)? else { return Ok(None) };
        StepProfile::new(&list).map(Some).map_err(|error| {
            let entry = index_of(&error).and_then(|index| entries.get(index - 1));
            let place = entry.map_or_else(|| section.place_of(key.name), |(_, it)| it.place());
            place.problem(wrap(error))
        })
    };
    let stop = |items: &[Item]| {
        let [at, name] = items else { return None };
        Some((at.number("", ..).ok()?, name.as_quoted()?.to_owned()))
    };
    let stops = section.entries_as(STOPS.name, STOPS.rule.allowed, stop)?;
    track.survey = TrackSurvey {
        gradient_falling: profile(&GRADIENT_FALLING, &GRADIENTS, TrackError::Gradient)?,
        gradient_std_permille: profile(&GRADIENT_STD, &GRADIENT_STDS, TrackError::Gradient)?,
        stops: stops.into_iter().flatten().map(|(stop, _)| stop).collect(),
        permitted_speed_mps: profile(&PERMITTED_SPEED, &SPEEDS, TrackError::PermittedSpeed)?,
        alignment: ALIGNMENT.quoted(section)?.map(Into::into),
        alignment_falling: ALIGNMENT_FALLING.quoted(section)?.map(Into::into),
    };
    Ok(track)
}

/// Adds the corrections that measured runs have shown: resistance at places, other masses in sections.
fn with_corrections(mut track: Track, section: &Item) -> Result<Track, DatasetError> {
    if let Some(shift_m) = GRADIENT_SHIFT.number(section)? {
        track.gradient_shift_m = shift_m;
    }
    let falling = gradient_error(section, &GRADIENT_ERROR_FALLING)?;
    match (gradient_error(section, &GRADIENT_ERROR)?, falling) {
        (Some(profile), falling) => {
            track.gradient_error = Some(GradientError { profile, falling });
        }
        (None, Some(_)) => {
            let of = GRADIENT_ERROR.name;
            let allowed = format!("the list {of} with it, for growing chainage");
            let found = format!("without {of}");
            return Err(section.key_out_of_range(GRADIENT_ERROR_FALLING.name, &found, &allowed));
        }
        (None, None) => {}
    }
    if let Some(entries) = RESISTANCE.entries::<3>(section)? {
        let places: Vec<IntervalValue> = entries
            .iter()
            .map(|&([start_m, end_m, value], _)| IntervalValue { start_m, end_m, value })
            .collect();
        track = track
            .with_resistance(&places)
            .map_err(|error| section.place_of(RESISTANCE.name).problem(error))?;
    }
    for (numbers, entry) in MASSES.entries::<4>(section)?.into_iter().flatten() {
        let [from_m, to_m, direction, mass_factor] = numbers;
        let is_sound =
            from_m < to_m && direction.abs() == 1.0 && (0.1..=10.0).contains(&mass_factor);
        if !is_sound {
            let found = format!("[{from_m}, {to_m}, {direction}, {mass_factor}]");
            let allowed = "from_m < to_m, direction 1 or -1, a factor from 0.1 to 10";
            return Err(entry.out_of_range(&found, allowed));
        }
        track.masses.push(MassSection { from_m, to_m, direction, mass_factor });
    }
    Ok(track)
}

/// Reads the error of the declared gradient, in one of its lists.
fn gradient_error(section: &Item, key: &FileKey) -> Result<Option<LinearProfile>, DatasetError> {
    let Some(entries) = key.entries::<2>(section)? else { return Ok(None) };
    let entries = entries.into_iter().map(|([at_m, permille], _)| (at_m, permille)).collect();
    let refused = |error| section.place_of(key.name).problem(TrackError::Gradient(error));
    LinearProfile::new(entries).map(Some).map_err(refused)
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
