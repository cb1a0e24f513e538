//! Contents as understood, in words and columns.

use dynocar_analysis::dataset::{Manifest, PositionReference, Quantity};
use dynocar_model::track::{LinearProfile, Track};
use dynocar_model::train::{BrakeGear, Corrections, EffortCurve, TrainModel};

use dynocar::cli::check as daemon;

use super::{Understood, runs};
use crate::run_facts;
use dynocar::cli::text::{WIDTH, line, short, wrap};

/// Returns the whole report.
pub(super) fn report(understood: &Understood) -> String {
    let dataset = understood.dataset.as_ref();
    let diagnostics = understood.diagnostics();
    let mut parts: Vec<String> = dataset.iter().map(|(manifest, _)| head(manifest)).collect();
    parts.extend(understood.train.as_deref().map(train));
    parts.extend(understood.track.as_deref().map(track));
    parts.extend(understood.daemon.as_ref().map(daemon::report));
    if let Some((manifest, runs)) = dataset {
        if understood.track.is_none() {
            parts.push("track    not known\n".into());
        }
        parts.push(columns(manifest));
        parts.push(runs::report(manifest, runs, &diagnostics));
    } else if !diagnostics.is_empty() {
        parts.push(format!("notes\n{}", run_facts::diagnostics(&diagnostics)));
    }
    parts.join("\n")
}

fn head(manifest: &Manifest) -> String {
    let mut text = format!("dataset  {}\n", manifest.name);
    if let Some(description) = &manifest.description {
        for line in wrap(description, WIDTH) {
            text += &format!("  {line}\n");
        }
    }
    text
}

fn train(train: &TrainModel) -> String {
    let davis = &train.resistance;
    let signed = |coefficient: f64| {
        let sign = if coefficient < 0.0 { '-' } else { '+' };
        format!("{sign} {}", short(coefficient.abs(), 8))
    };
    let resistance = format!(
        "w0 = {} {} v {} v² N/kN, v in m/s",
        short(davis.a, 6),
        signed(davis.b),
        signed(davis.c)
    );
    let mut text = format!("train    {}\n", train.name);
    let tons = |kg: f64| short(kg / 1000.0, 3);
    let full = train.full_mass_kg.map(|it| format!(" to {}", tons(it)));
    let mass_t = tons(train.mass_kg) + &full.unwrap_or_default();
    let gamma = short(train.rotating_mass_factor, 6);
    text += &line("mass", &format!("{mass_t} t, rotating-mass factor {gamma}"));
    let cars = if train.cars == 1 { "1 car".into() } else { format!("{} cars", train.cars) };
    text += &line("length", &format!("{} m, {cars}", short(train.length_m, 3)));
    text += &line("resistance", &resistance);
    text += &line("", &resistance_at_speeds(train));
    text += &line(
        "in curves",
        &match train.curve_constant_n_per_kn_m {
            0.0 => "none declared".into(),
            constant => format!("{} / R N/kN, R in m", short(constant, 3)),
        },
    );
    text += &line(
        "in tunnels",
        &match train.tunnel_constant_n_per_kn_m {
            0.0 => "none declared".into(),
            constant => format!("{} N/kN per m of tunnel", short(constant, 8)),
        },
    );
    text += &line("traction", &effort(train.traction.as_ref()));
    text += &line("brake", &effort(train.brake.as_ref()));
    if train.brake_gear != BrakeGear::default() {
        text += &line("brake gear", &brake_gear(&train.brake_gear));
    }
    if train.corrections != Corrections::NONE {
        for (index, words) in corrections(&train.corrections).iter().enumerate() {
            text += &line(if index == 0 { "corrections" } else { "" }, words);
        }
    }
    for (index, extra) in train.extra.iter().enumerate() {
        text += &line(if index == 0 { "extra force" } else { "" }, &extra.law());
    }
    text
}

/// Describes the additions of measured runs to the declared model, as far as they change something.
fn corrections(known: &Corrections) -> Vec<String> {
    let none = Corrections::NONE;
    let signed = |value: f64, decimals| {
        let sign = if value < 0.0 { "-" } else { "+" };
        format!("{sign}{}", short(value.abs(), decimals))
    };
    let wind = format!("headwind {} m/s as the chainage grows", signed(known.wind_plus_mps, 3));
    let bearings = format!(
        "{} N/kN of cold bearings, fading in {} s",
        signed(known.bearing_delta_a_n_per_kn, 4),
        short(known.bearing_tau_s, 1)
    );
    let ambient = format!(
        "{} % of w0 per kelvin above {} K",
        signed(100.0 * known.ambient_w0_per_k, 4),
        short(known.ambient_reference_k, 2)
    );
    let number = |number: fn(&Corrections) -> f64, before: &str, decimals, after: &str| {
        let words = format!("{before}{}{after}", short(number(known), decimals));
        (number(known) != number(&none), words)
    };
    let all = [
        number(|it| it.speed_scale, "measured over true speed ", 5, ""),
        number(|it| it.speed_delay_s, "the measured speed is ", 3, " s late"),
        number(|it| it.speed_lag_s, "the measured speed follows with a time constant of ", 3, " s"),
        number(|it| it.traction_gain, "reported over true traction ", 5, ""),
        number(|it| it.brake_gain, "reported over true brake force ", 5, ""),
        number(|it| it.brake_delay_s, "the brake acts ", 3, " s late"),
        number(|it| it.brake_lag_s, "the brake builds up with a time constant of ", 3, " s"),
        number(|it| it.actuator_delay_s, "forces act ", 3, " s late"),
        number(|it| it.actuator_lag_s, "forces build up with a time constant of ", 3, " s"),
        number(|it| it.tunnel_c_factor, "", 4, " c v² in tunnels"),
        number(|it| it.tunnel_dc_n_per_kn_per_mps2, "c ", 6, " greater in tunnels"),
        (known.wind_plus_mps != 0.0, wind),
        (known.bearing_delta_a_n_per_kn > 0.0, bearings),
        (known.ambient_w0_per_k != 0.0, ambient),
    ];
    let acting: Vec<String> =
        all.into_iter().filter(|(acts, _)| *acts).map(|(_, words)| words).collect();
    if acting.is_empty() { vec!["none that changes anything".into()] } else { acting }
}

/// Returns the declared resistance in kN at a few speeds, which shows a wrong unit at a glance.
fn resistance_at_speeds(train: &TrainModel) -> String {
    let top_mps = train.speed_max_mps().filter(|&speed| speed > 0.0).unwrap_or(120.0 / 3.6);
    let weight_kn = TrainModel::weight_kn(train.mass_kg);
    let at = |share: f64| {
        let speed_mps = share * top_mps;
        let force_kn = train.resistance.w0_n_per_kn(speed_mps) * weight_kn / 1000.0;
        format!("{} kN at {} km/h", short(force_kn, 2), short(speed_mps * 3.6, 0))
    };
    [0.0, 0.5, 1.0].map(at).join(", ")
}

fn effort(curve: Option<&EffortCurve>) -> String {
    let Some(curve) = curve else { return "not declared".into() };
    let most_kn = short(curve.force_max_n() / 1000.0, 3);
    match curve.points() {
        [_] => format!("{most_kn} kN at any speed"),
        points => {
            let (speed_mps, force_n) = points[points.len() - 1];
            let (speed_kmh, force_kn) = (short(speed_mps * 3.6, 1), short(force_n / 1000.0, 3));
            let count = points.len();
            format!("up to {most_kn} kN, {force_kn} kN at {speed_kmh} km/h ({count} points)")
        }
    }
}

fn brake_gear(gear: &BrakeGear) -> String {
    let parts = [
        (gear.cylinder_diameter_mm, "cylinder diameter", " mm"),
        (gear.disc_radius_mm, "disc radius", " mm"),
        (gear.wheel_radius_mm, "wheel radius", " mm"),
        (gear.efficiency, "efficiency", ""),
        (gear.ratio, "ratio", ""),
        (gear.friction, "friction", ""),
        (gear.pads, "pads", ""),
    ];
    let shown = parts.iter().filter_map(|(value, name, unit)| {
        value.map(|value| format!("{name} {}{unit}", short(value, 4)))
    });
    shown.collect::<Vec<_>>().join(", ")
}

fn track(track: &Track) -> String {
    let mut text = format!("track    {}\n", track.name);
    let length = track.length_m.map(|length| format!("{} km", short(length / 1000.0, 3)));
    text += &line("length", length.as_deref().unwrap_or("not declared"));
    text += &line("gradient", &gradient(track));
    text += &line("curves", &curves(track));
    text += &line("tunnels", &tunnels(track));
    let survey = &track.survey;
    if !survey.stops.is_empty() {
        text += &line("stops", &survey.stops.len().to_string());
    }
    if let Some(permitted) = &survey.permitted_speed_mps {
        let (low, high) = range(permitted.entries().map(|(_, speed_mps)| 3.6 * speed_mps));
        text += &line("permitted", &format!("{} to {} km/h", short(low, 1), short(high, 1)));
    }
    text + &found(track)
}

fn gradient(track: &Track) -> String {
    let Some(profile) = track.gradient() else { return "not known".into() };
    let (low, high) = range(profile.entries().map(|(_, permille)| permille));
    let from_km = profile.entries().next().map_or(0.0, |entry| entry.0) / 1000.0;
    let to_km = profile.entries().last().map_or(0.0, |entry| entry.0) / 1000.0;
    let (low, high) = (short(low, 2), short(high, 2));
    let (from, to) = (short(from_km, 3), short(to_km, 3));
    format!("{low} to {high} ‰, {} entries, km {from} to {to}", profile.entries().len())
}

fn curves(track: &Track) -> String {
    let lengths_m = track.curves().iter().map(|curve| curve.end_m - curve.start_m);
    let (low, high) = range(track.curves().iter().map(|curve| curve.radius_m));
    let more = format!("radius {} to {} m", short(low, 1), short(high, 1));
    intervals(track.knows_curves(), lengths_m, &more)
}

fn tunnels(track: &Track) -> String {
    let lengths_m = track.tunnels().iter().map(|tunnel| tunnel.end_m - tunnel.start_m);
    let more = format!("the longest {} m", short(range(lengths_m.clone()).1, 1));
    intervals(track.knows_tunnels(), lengths_m, &more)
}

/// Returns the number of intervals, their total length, and further remarks.
fn intervals(is_known: bool, lengths_m: impl ExactSizeIterator<Item = f64>, more: &str) -> String {
    match (is_known, lengths_m.len()) {
        (false, _) => "not known".into(),
        (true, 0) => "none".into(),
        (true, count) => {
            let km = short(lengths_m.sum::<f64>() / 1000.0, 2);
            format!("{count}, {km} km in all, {more}")
        }
    }
}

/// Describes the findings on the line besides its survey.
fn found(track: &Track) -> String {
    let mut text = String::new();
    if track.gradient_shift_m != 0.0 {
        let shift = short(track.gradient_shift_m, 1);
        text += &line("shift", &format!("the gradient lies {shift} m further"));
    }
    if let Some(error) = &track.gradient_error {
        let both = [Some(&error.profile), error.falling.as_ref()];
        let entries = || both.into_iter().flatten().flat_map(LinearProfile::entries);
        let (low, high) = range(entries().map(|(_, permille)| *permille));
        let (low, high, count) = (short(low, 3), short(high, 3), entries().count());
        let lacks = format!("the gradient lacks {low} to {high} ‰ at {count} chainages");
        text += &line("error", &lacks);
    }
    if let Some(profile) = track.resistance() {
        let places: Vec<f64> =
            profile.entries().map(|(_, extra)| extra).filter(|extra| *extra != 0.0).collect();
        let (low, high) = range(places.iter().copied());
        let extra = match places.len() {
            0 => "at no place".into(),
            1 => format!("{} N/kN at 1 place", short(low, 4)),
            count => format!("{} to {} N/kN at {count} places", short(low, 4), short(high, 4)),
        };
        text += &line("resistance", &format!("further {extra}"));
    }
    if !track.masses.is_empty() {
        let factors = track.masses.iter().map(|section| section.mass_factor);
        let (low, high) = range(factors);
        let (low, high, count) = (short(low, 4), short(high, 4), track.masses.len());
        let sections = if count == 1 { "section" } else { "sections" };
        text += &line("masses", &format!("{low} to {high} of the declared, {count} {sections}"));
    }
    text
}

/// Returns the lowest and the highest of numbers.
pub(super) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

fn columns(manifest: &Manifest) -> String {
    let mut text = match (manifest.mapping(Quantity::Position), manifest.position_reference) {
        (None, _) => "columns\n".into(),
        (_, PositionReference::Centre) => String::from("columns  position of the train's centre\n"),
        (_, PositionReference::Head) => "columns  position of the train's head\n".into(),
    };
    let width = manifest.columns.iter().map(|mapping| mapping.quantity.name().len()).max();
    for mapping in &manifest.columns {
        let scale = match mapping.scale {
            1.0 => String::new(),
            scale => format!(" * {scale}"),
        };
        let offset = match mapping.offset {
            0.0 => String::new(),
            offset if offset < 0.0 => format!(" - {}", -offset),
            offset => format!(" + {offset}"),
        };
        let (name, width) = (mapping.quantity.name(), width.unwrap_or(0));
        let read_as = match &mapping.format {
            Some(format) => format!("as times like {}", format.example()),
            None => format!("in {}", mapping.unit.name()),
        };
        text += &format!("  {name:width$}  {}{scale}{offset} {read_as}\n", mapping.shown());
    }
    text
}
