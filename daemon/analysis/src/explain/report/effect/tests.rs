//! Effects in words.

use std::collections::BTreeMap;

use dynocar_model::words;

use super::*;
use crate::explain::answer::{
    CovariateRange, EffectAnswer, EffectMeaning, FoundMassSection, Location, ParameterValue,
    PlaceUncertainty, RunWindow, WithStd,
};
use crate::explain::selection::ScaleSources;

#[test]
fn a_change_of_mass_has_its_interval_and_a_range_its_unit() {
    let section = |direction, mass_factor| FoundMassSection {
        from_m: 0.0,
        to_m: 5000.0,
        direction,
        mass_factor,
    };
    let sections = ParameterValue::Sections(vec![section(1, 1.029), section(-1, 0.98)]);
    let of = |value| BTreeMap::from([("sections".to_owned(), value)]);
    let said = sizes(&of(sections), &of(ParameterValue::List(vec![0.0193, 0.005])));
    assert_eq!(said[0], "+2.9 ± 3.8 % from km 0.00 to 5.00 (direction +1)");
    assert_eq!(said[1], "−2.0 ± 1.0 % from km 0.00 to 5.00 (direction −1)");
    let covariate = CovariateRange { name: "traction_force_n".into(), range: [4.6e5, 6.5e5] };
    let range = Some([Some([4.5e5, 4.7e5]), None]);
    let place = Location {
        covariate: Some(covariate),
        uncertainty_95: Some(PlaceUncertainty { range, ..PlaceUncertainty::default() }),
        ..Location::default()
    };
    assert!(located(&place).unwrap().ends_with("ends known to ± 10000 N or better"));
}

#[test]
fn what_an_effect_means_is_said_in_kwh_and_metres() {
    let costs = EffectMeaning {
        energy_kwh_per_100_km: 41.26,
        share_of_traction_energy: Some(0.0312),
        distance_error_60_s_m: Some([14.52, 2.13]),
    };
    assert_eq!(
        meaning(&costs),
        "41.3 kWh per 100 km more, 3.1 % of the traction's energy; a minute ahead, the model errs by \
         14.5 m without this effect, 2.1 m with it"
    );
    let helps = EffectMeaning {
        energy_kwh_per_100_km: -2.0,
        share_of_traction_energy: Some(-0.01),
        distance_error_60_s_m: None,
    };
    assert_eq!(meaning(&helps), "2.00 kWh per 100 km less, 1.0 % of the traction's energy");
    assert_eq!(meaning(&EffectMeaning::default()), "");
}

#[test]
fn places_are_reported_in_words_with_the_precision_of_their_ends() {
    let known = PlaceUncertainty {
        intervals_m: Some(vec![[[5180.0, 5220.0], [6890.0, 6910.0]]]),
        ..PlaceUncertainty::default()
    };
    let tunnel =
        Location { uncertainty_95: Some(known), ..Location::of_intervals(vec![[5200.0, 6900.0]]) };
    assert_eq!(
        located(&tunnel).as_deref(),
        Some("from km 5.20 to 6.90, ends known to ± 20 m or better")
    );
    let window = RunWindow { run: "runs/03.csv".into(), t_start_s: 204.0, t_end_s: 729.6 };
    let covariate = CovariateRange { name: "brake_force_n".into(), range: [1e3, 2.5e4] };
    let place = Location {
        windows: Some(vec![window]),
        speed_range_mps: Some([10.0, 12.5]),
        covariate: Some(covariate),
        ..Location::default()
    };
    assert_eq!(
        located(&place).as_deref(),
        Some(
            "in runs/03.csv from 204 to 730 s, at 10.0 to 12.5 m/s, \
             while brake_force_n is 1000 to 25000"
        )
    );
    assert_eq!(located(&Location::default()), None);
}

/// An effect with a number and its standard deviation.
fn effect(kind: &'static str, place: Location, [value, std]: [f64; 2]) -> EffectAnswer {
    let number = |value| [("force_n".to_string(), ParameterValue::Number(value))].into();
    EffectAnswer {
        kind,
        place,
        parameters: number(value),
        std: number(std),
        p_value: 1e-9,
        error_reduction: 0.8,
        meaning: EffectMeaning::default(),
        contradiction: None,
        over_time: Vec::new(),
        held_out: None,
        runners_up: Vec::new(),
    }
}

#[test]
fn an_effect_is_reported_with_its_size_and_interval() {
    let place = Location { runs: Some(vec!["runs/02.csv".into()]), ..Location::default() };
    assert_eq!(
        described(&effect("dragging_brake", place, [3058.6, 107.5])),
        "a dragging brake in runs/02.csv – drag force 3059 N (95 % interval 2848 to 3269)"
    );
}

#[test]
fn an_effect_along_the_line_is_where_its_values_are_and_others_are_everywhere() {
    let everywhere = effect("rotating_mass", Location::default(), [0.1, 0.01]);
    assert_eq!(place(&everywhere), "everywhere");
    let nodes = ParameterValue::Profile(vec![[120.0, 0.3], [5000.0, -0.2], [9880.0, 0.1]]);
    let of_line = EffectAnswer { parameters: [("profile".into(), nodes)].into(), ..everywhere };
    assert_eq!(place(&of_line), words::stretches(&[[120.0, 9880.0]]));
    let local = Location::of_intervals(vec![[1000.0, 2000.0]]);
    assert_eq!(place(&EffectAnswer { place: local.clone(), ..of_line }), located(&local).unwrap());
}

#[test]
fn contradicting_scales_are_stated_in_percent_with_their_intervals() {
    let [positions, motion] =
        [(1.015, 0.001), (1.003, 0.002)].map(|(value, std)| WithStd { value, std });
    let sentence = contradicting_scales(&ScaleSources { positions, motion });
    assert!(sentence.contains("+1.50 ± 0.20 %") && sentence.contains("+0.30 ± 0.39 %"));
}
