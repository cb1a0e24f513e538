//! The scenarios of the table.

use super::world::{LoadSource, Scenario, Traffic};

/// A scenario with its name.
#[derive(Clone, Debug)]
pub struct NamedScenario {
    /// Traffic, then what is particular.
    pub name: String,
    /// The scenario.
    pub scenario: Scenario,
}

const TRAFFIC: [(&str, Traffic); 4] = [
    ("metro", Traffic::Metro),
    ("EMU", Traffic::Emu),
    ("freight", Traffic::Freight),
    ("high speed", Traffic::HighSpeed),
];

const LOADS: [(&str, LoadSource); 5] = [
    ("load exact", LoadSource::Exact),
    ("weighed 2 % wrong", LoadSource::Weighed(20)),
    ("weighed 5 % wrong", LoadSource::Weighed(50)),
    ("load unknown", LoadSource::Unknown),
    ("load changes at stops", LoadSource::Changing),
];

/// All rows: each load, and the ordinary one with everything else varied.
pub fn all() -> Vec<NamedScenario> {
    TRAFFIC.iter().flat_map(|&(name, traffic)| of(name, traffic)).collect()
}

fn of(traffic_name: &str, traffic: Traffic) -> Vec<NamedScenario> {
    let usual = Scenario {
        traffic,
        load: LoadSource::Weighed(20),
        jumps: false,
        rate_hz: 10,
        speed_noise_mps: 0.03,
        position_noise_m: 2.0,
        map_std_permille: 0.1,
    };
    let varied = [
        ("forces jump", Scenario { jumps: true, ..usual }),
        ("5 Hz", Scenario { rate_hz: 5, ..usual }),
        ("50 Hz", Scenario { rate_hz: 50, ..usual }),
        ("map exact", Scenario { map_std_permille: 0.0, ..usual }),
        (
            "free of noise",
            Scenario {
                map_std_permille: 0.0,
                speed_noise_mps: 0.0,
                position_noise_m: 0.0,
                ..usual
            },
        ),
    ];
    let loads = LOADS.map(|(name, load)| (name, Scenario { load, ..usual }));
    loads
        .into_iter()
        .chain(varied)
        .map(|(name, scenario)| NamedScenario { name: format!("{traffic_name}, {name}"), scenario })
        .collect()
}
