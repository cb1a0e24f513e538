//! railtoolkit's running paths: sections of permitted speed and resistance. The schema of 2022.05 writes
//! a section as a list, the later main as keys and values, of which speed or resistance may be missing.

use super::imported::{Account, ImportedLine};
use super::rolling_stock::unique;
use crate::dataset::DatasetError;
use crate::dataset::document::{Item, above_zero};
use crate::dataset::keys::track::{LENGTH, PERMITTED_SPEED};

const SECTIONS: &str = "characteristic_sections";
/// Reasons why fields have no key, and these fields.
const WITHOUT_PLACE: [(&str, &str); 3] = [
    ("track.toml holds no identifier", "UUID"),
    ("track.toml holds no description", "description"),
    ("points where a run is to be measured, no stops", "points_of_interest"),
];

/// A section from `position_m` to the next section.
struct Section {
    position_m: f64,
    speed_mps: Option<f64>,
    resistance_permille: Option<f64>,
}

/// Returns the paths of a file.
pub(super) fn lines(root: &Item) -> Result<Vec<ImportedLine>, DatasetError> {
    let mut seen: Vec<(&str, Item)> = Vec::new();
    let mut lines = Vec::new();
    for item in root.need("paths", "a list of paths")?.list("paths", 1)? {
        let id = item.need_text("id", "an identifier")?;
        unique(seen.iter().map(|(id, it)| (*id, it)), id, &item)?;
        lines.push(line(&item, id)?);
        seen.push((id, item));
    }
    Ok(lines)
}

fn line(item: &Item, id: &str) -> Result<ImportedLine, DatasetError> {
    let items = item.need(SECTIONS, "a list of sections")?.list("sections", 2)?;
    // The names became optional with the keys.
    let name = match (item.get("name"), items[0].is_list()) {
        (None, false) => id,
        _ => item.need_text("name", "a name")?,
    };
    let mut account = Account::default();
    let mut sections: Vec<Section> = Vec::new();
    for item in &items {
        let section = if item.is_map() { by_keys(item)? } else { by_place(item)? };
        account.rest("paths.characteristic_sections.", item, &[]);
        let before = sections.last().map(|before| before.position_m);
        if let Some(before_m) = before.filter(|before_m| section.position_m <= *before_m) {
            let allowed = format!("a position above the one before ({before_m} m)");
            return Err(item.out_of_range(&format!("{} m", section.position_m), &allowed));
        }
        sections.push(section);
    }
    let (first_m, last_m) = (sections[0].position_m, sections[sections.len() - 1].position_m);
    let positions = "paths.characteristic_sections.position";
    account.taken(positions, LENGTH.name, "m, the last less the first");
    let mut given = |list: Vec<(f64, f64)>, field: &str, key: &'static str, how: &str| {
        let how = format!("{how}{}", list.first().map_or("".into(), |it| since(it.0, first_m)));
        let list = Some(list).filter(|list| !list.is_empty());
        let name = format!("paths.characteristic_sections.{field}");
        account.given(list, &name, (key, &how), &format!("no section has a {field}"))
    };
    let gradient = steps(&sections, |it| it.resistance_permille);
    let gradient = given(gradient, "resistance", "gradient", "‰, whatever resists");
    let permitted = steps(&sections, |it| it.speed_mps);
    let permitted_speed = given(permitted, "speed", PERMITTED_SPEED.name, "km/h / 3.6");
    account.unknown("curves", "the format has none: its resistance holds theirs with the gradient");
    account.unknown("tunnels", "the format has none");
    account.unknown("stops", "the format has none");
    account.rest("paths.", item, &WITHOUT_PLACE);
    Ok(ImportedLine {
        id: id.into(),
        place: item.place(),
        name: name.into(),
        length_m: last_m - first_m,
        gradient,
        curves: None,
        stops: Vec::new(),
        permitted_speed,
        account,
    })
}

/// Returns the values where they change; the last section only ends the line.
fn steps(sections: &[Section], value: impl Fn(&Section) -> Option<f64>) -> Vec<(f64, f64)> {
    let mut steps: Vec<(f64, f64)> = Vec::new();
    for section in &sections[..sections.len() - 1] {
        let Some(value) = value(section) else { continue };
        if steps.last().is_none_or(|last| last.1 != value) {
            steps.push((section.position_m, value));
        }
    }
    steps
}

/// Returns the note on a list that begins after the line does.
fn since(from_m: f64, first_m: f64) -> String {
    if from_m == first_m {
        return String::new();
    }
    format!("; the file gives it from {from_m} m on, and the first value holds before it too")
}

const POSITION: &str = "a position in m, within 1e9";
const SPEED: &str = "a speed in km/h above 0, at most 720";
const RESISTANCE: &str = "a resistance in permil from -150 to 150";

fn position_m(item: &Item) -> Result<f64, DatasetError> {
    item.number(POSITION, -1e9..=1e9)
}

fn speed_mps(item: &Item) -> Result<f64, DatasetError> {
    Ok(item.number(SPEED, above_zero(720.0))? / 3.6)
}

fn permille(item: &Item) -> Result<f64, DatasetError> {
    item.number(RESISTANCE, -150.0..=150.0)
}

/// Returns a section as `[m, km/h, ‰]`.
fn by_place(item: &Item) -> Result<Section, DatasetError> {
    let [position, speed, resistance] =
        item.tuple("[position m, speed km/h, resistance permil]")?;
    Ok(Section {
        position_m: position_m(&position)?,
        speed_mps: Some(speed_mps(&speed)?),
        resistance_permille: Some(permille(&resistance)?),
    })
}

/// Returns a section as keys and values.
fn by_keys(item: &Item) -> Result<Section, DatasetError> {
    let speed = item.get("speed").map(|it| speed_mps(&it)).transpose()?;
    let resistance = item.get("resistance").map(|it| permille(&it)).transpose()?;
    if speed.is_none() && resistance.is_none() {
        item.need("speed", "a speed in km/h, or a resistance in permil")?;
    }
    Ok(Section {
        position_m: position_m(&item.need("position", POSITION)?)?,
        speed_mps: speed,
        resistance_permille: resistance,
    })
}
