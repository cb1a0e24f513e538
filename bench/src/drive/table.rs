//! The figures as tables of Markdown, which read in a terminal too.

use super::score::{Figure, Scored};

/// All services.
pub fn tables(scored: &[Scored]) -> String {
    format!("{}\n{}\n{}", drives(scored), answers(scored), comparisons(scored))
}

fn ranged(figure: Figure, digits: usize) -> String {
    let Figure { value, low, high } = figure;
    match value.is_finite() {
        true => format!("{value:.digits$} ({low:.digits$}–{high:.digits$})"),
        false => "–".into(),
    }
}

fn drives(scored: &[Scored]) -> String {
    let mut text = String::from(
        "| scenario | parameters | stops | beyond cm | spread cm | within 0.3 m % | within 0.5 m % \
         | energy % | off the timetable s | jerk m/s³ | bounds exceeded | bound % | fixed bound % |\n\
         | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for line in scored.iter().flat_map(|it| &it.lines) {
        let cm = |it: Figure| Figure {
            value: 100.0 * it.value,
            low: 100.0 * it.low,
            high: 100.0 * it.high,
        };
        let exceeded = line.exceeded.map(|count| format!("{count} of {}", line.bounds));
        let bound = line.bound_percent.map(|percent| format!("{percent:.0}"));
        text += &format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2} | {} | {} | {:.0} |\n",
            line.scenario,
            line.driver,
            line.stops,
            ranged(cm(line.beyond_m), 0),
            ranged(cm(line.spread_m), 0),
            ranged(line.within_03_percent, 0),
            ranged(line.within_05_percent, 0),
            ranged(line.energy_percent, 1),
            ranged(line.late_s, 1),
            line.jerk_mps3.value,
            exceeded.unwrap_or("–".into()),
            bound.unwrap_or("–".into()),
            line.fixed_percent,
        );
    }
    text
}

fn answers(scored: &[Scored]) -> String {
    let mut text = String::from(
        "| scenario | quantity | usable % | wrong % | worse than declared % | error % | declared error % \
         | first use s | changes per stop |\n\
         | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for it in scored.iter().flat_map(|it| &it.answers) {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or("–".to_owned(), |value| format!("{value:.digits$}"))
        };
        text += &format!(
            "| {} | {} | {:.1} | {:.2} | {:.1} | {} | {} | {} | {:.1} |\n",
            it.scenario,
            it.quantity,
            it.usable_percent,
            it.wrong_percent,
            it.worse_percent,
            number(it.error_percent[0], 1),
            number(it.error_percent[1], 1),
            number(it.first_s, 0),
            it.changes_per_stop,
        );
    }
    text
}

fn comparisons(scored: &[Scored]) -> String {
    let mut text = String::from(
        "| scenario | better with Dynocar | worse with Dynocar |\n| --- | --- | --- |\n",
    );
    for it in scored.iter().map(|it| &it.comparison) {
        let list = |items: &[String]| match items.is_empty() {
            true => "–".to_owned(),
            false => items.join("; "),
        };
        text += &format!(
            "| {} | {} | {} |\n",
            it.scenario,
            list(&it.listed(true)),
            list(&it.listed(false))
        );
    }
    text
}
