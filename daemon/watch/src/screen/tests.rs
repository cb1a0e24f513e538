//! The screen, cell by cell, from a state without any clock.
//!
//! The expected screens are in `drawn`; a failing test prints the screen that it has drawn.

use dynocar_shared::snapshot::packed_index;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason, RejectionReason, Status, TrainId,
};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::Color;

use crate::cli::line;
use crate::screen::{Palette, ScreenChoice, ScreenView, draw};
use crate::state::{Daemon, PipelineState, PlotHistory, TrainState};

fn pipeline(
    index: u32,
    kind: PipelineKind,
    (status, reason): (Status, Reason),
    parameters: &[(Parameter, [f64; 2])],
) -> PipelineState {
    let mut snapshot = ParameterSnapshot::empty();
    snapshot.pipeline_index = index;
    snapshot.pipeline_kind = kind as u32;
    snapshot.sample_sequence = 20_312;
    snapshot.samples_used = 20_310;
    snapshot.samples_rejected = 2;
    snapshot.rejected_by_reason[RejectionReason::Outlier as usize] = 2;
    snapshot.published_ns = 17_000;
    snapshot.speed_min_mps = 1.0;
    snapshot.speed_max_mps = 23.0;
    snapshot.parameter_count = parameters.len() as u32;
    for (place, &(parameter, [value, std])) in parameters.iter().enumerate() {
        snapshot.parameters[place] = parameter as u32;
        snapshot.values[place] = value;
        snapshot.covariance[packed_index(place, place)] = std * std;
    }
    let (reason, sample_age_s) = (Some(reason), Some(0.04));
    let name = kind.name().to_owned();
    let history = PlotHistory::default();
    PipelineState { name, snapshot, status, reason, sample_age_s, history }
}

fn train() -> TrainState {
    let good = (Status::Estimated, Reason::None);
    let davis = [
        (Parameter::DavisA, [1.498, 0.027]),
        (Parameter::DavisB, [0.0131, 0.0042]),
        (Parameter::DavisC, [0.000_91, 0.000_17]),
    ];
    let weak = (Status::Estimated, Reason::WeakExcitation);
    let mut resistance = pipeline(0, PipelineKind::TrajectoryKalman, weak, &davis);
    resistance.snapshot.quantities = Quantity::Resistance.bit();
    resistance.snapshot.usable_quantities = Quantity::Resistance.bit();
    let mass = [(Parameter::Mass, [1697.4, 6.1]), (Parameter::AccelerationBias, [1e-4, 1e-4])];
    let mut mass = pipeline(1, PipelineKind::MassKalman, good, &mass);
    mass.snapshot.quantities = Quantity::Mass.bit();
    mass.snapshot.usable_quantities = Quantity::Mass.bit();
    let bound = (Status::Unestimated, Reason::OnlyLowerBound);
    let adhesion = [(Parameter::AdhesionLowerBound, [0.0943, 0.0])];
    let mut adhesion = pipeline(2, PipelineKind::AdhesionLaw, bound, &adhesion);
    adhesion.snapshot.quantities = Quantity::Adhesion.bit();
    let mut monitor = pipeline(3, PipelineKind::ResidualMonitor, good, &[]);
    monitor.snapshot.unexplained_force_std_n = 410.0;
    monitor.snapshot.innovation_mean_square = 1.04;
    for second in 0..120_i64 {
        monitor.snapshot.sample_sequence = 20_312 + 5 * second as u64;
        monitor.snapshot.unexplained_force_n = 25.0 * (second % 40) as f64 - 300.0;
        monitor.history.push(&monitor.snapshot, 1_000_000_000 * second);
    }
    TrainState {
        id: TrainId(1),
        name: Some("locomotive-hauled freight train P01-35".into()),
        daemon: Daemon::Serving { version: "0.1.0".into(), process_id: 4711 },
        up_s: Some(260.0),
        pipelines: vec![resistance, mass, adhesion, monitor],
        advice: vec![
            "60 s coasting from 25 m/s (90 km/h) halves the interval of c".into(),
            "adhesion: the rail carries at least this; more shows only when wheels slide".into(),
        ],
    }
}

fn suspected() -> TrainState {
    let mut train = train();
    let monitor = &mut train.pipelines[3];
    monitor.status = Status::Degraded;
    monitor.reason = Some(Reason::InnovationsNotWhite);
    monitor.snapshot.suspected_effect = EffectKind::DraggingBrake as u32;
    monitor.snapshot.suspected_alternatives = EffectKind::Wind.bit();
    monitor.snapshot.suspicion_age_s = 132;
    monitor.snapshot.suspicion_evidence = 46.0;
    train
}

fn buffer(
    trains: &[&TrainState],
    choice: ScreenChoice,
    size: (u16, u16),
    has_colour: bool,
) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    let palette = Palette::new(has_colour);
    terminal.draw(|frame| draw(frame, trains, choice, "/run/dynocar", palette)).unwrap();
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let width = usize::from(buffer.area.width);
    let row = |cells: &[ratatui::buffer::Cell]| {
        let row: String = cells.iter().map(|cell| cell.symbol()).collect();
        row.trim_end().to_owned() + "\n"
    };
    buffer.content.chunks(width).map(row).collect()
}

fn screen(trains: &[&TrainState], choice: ScreenChoice, size: (u16, u16)) -> String {
    text(&buffer(trains, choice, size, true))
}

#[track_caller]
fn assert_screen(drawn: &str, expected: &str) {
    assert!(drawn == expected, "expected:\n{expected}\ndrawn:\n{drawn}");
}

#[test]
fn all_of_a_train_is_on_80_by_24() {
    let drawn = screen(&[&train()], ScreenChoice::default(), (80, 24));
    assert_screen(&drawn, include_str!("drawn/overview_80x24.txt"));
}

#[test]
fn a_larger_terminal_gets_more_speeds_and_plots() {
    let drawn = screen(&[&train()], ScreenChoice::default(), (160, 50));
    assert_screen(&drawn, include_str!("drawn/overview_160x50.txt"));
}

#[test]
fn a_suspect_is_reported_with_what_is_hardly_distinguished_from_it() {
    let drawn = screen(&[&suspected()], ScreenChoice::default(), (80, 24));
    assert!(
        drawn.contains("dragging_brake for 2 min, evidence 46, could also be: wind"),
        "{drawn}"
    );
}

#[test]
fn the_pipelines_show_their_samples() {
    let choice = ScreenChoice { view: ScreenView::Pipelines, ..ScreenChoice::default() };
    let drawn = screen(&[&train(), &suspected()], choice, (80, 24));
    assert_screen(&drawn, include_str!("drawn/pipelines_80x24.txt"));
}

#[test]
fn a_daemon_that_is_absent_gone_or_incompatible_is_reported_in_words() {
    let nobody = screen(&[], ScreenChoice::default(), (80, 24));
    assert!(nobody.contains("No daemon serves any train under /run/dynocar"), "{nobody}");
    let mut it = TrainState::new(TrainId(7), None);
    let absent = screen(&[&it], ScreenChoice::default(), (80, 24));
    assert!(absent.contains("train 7") && absent.contains("no daemon serves it"), "{absent}");
    it.daemon = Daemon::Unreadable("train 7: the daemon is incompatible: schema 2".into());
    let other = screen(&[&it], ScreenChoice::default(), (80, 24));
    assert!(other.contains("the daemon is incompatible: schema 2"), "{other}");
    let mut gone = train();
    gone.daemon = Daemon::Gone;
    gone.pipelines[1].status = Status::Invalid;
    gone.pipelines[1].reason = Some(Reason::DaemonSilent);
    let gone = screen(&[&gone], ScreenChoice::default(), (80, 24));
    assert!(gone.contains("the daemon is gone") && gone.contains("daemon_silent"), "{gone}");
    assert!(gone.contains("1697"), "what it said last stays: {gone}");
}

#[test]
fn nothing_is_coloured_where_no_colour_is_wanted() {
    let coloured = |has_colour| {
        let buffer = buffer(&[&suspected()], ScreenChoice::default(), (80, 24), has_colour);
        buffer.content.iter().any(|cell| cell.fg != Color::Reset || cell.bg != Color::Reset)
    };
    assert!(coloured(true));
    assert!(!coloured(false));
}

#[test]
fn every_size_is_drawn_and_too_small_ones_say_so() {
    for width in [1, 20, 59, 60, 79, 103, 104, 300] {
        for height in [1, 5, 19, 20, 23, 31, 60] {
            for view in [ScreenView::Overview, ScreenView::Pipelines] {
                for has_help in [false, true] {
                    let choice = ScreenChoice { train: 9, view, has_help };
                    screen(&[&suspected()], choice, (width, height));
                }
            }
        }
    }
    let small = screen(&[&train()], ScreenChoice::default(), (40, 10));
    assert!(small.contains("40 x 10 is too small"), "{small}");
}

#[test]
fn a_line_says_all_of_a_train() {
    let line = line(&suspected());
    for part in [
        "train 1: daemon 0.1.0 (process 4711)",
        "resistance usable (weak_excitation)",
        "a 1.498 ± 0.053 N/kN",
        "mass 1697 ± 12 t usable",
        "adhesion ≥ 0.094 learning (only_lower_bound)",
        "suspect dragging_brake",
        "used 20310, rejected 2 (most: outlier), lost 0",
        "next: 60 s coasting from 25 m/s (90 km/h) halves the interval of c",
    ] {
        assert!(line.contains(part), "{part:?} in {line}");
    }
    assert!(!line.contains('\n'));
}
