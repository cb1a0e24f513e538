//! Whole datasets, from their texts to samples.

use dynocar_shared::{RejectionReason, SampleField};

use super::*;

mod arbitrary;
mod columns;
mod lacking;

const TRAIN: &str = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n\
    [resistance]\na=1\nb=0\nc=0\n[traction]\neffort=[[0,100],[30,40]]\n";
const TRACK: &str = "[track]\nlength_m=5000\ngradient=[[0,3],[1000,-2]]\n";

/// A dataset with a train, the given columns besides time and speed, and one run.
struct Example {
    dataset: String,
    track: bool,
    columns: String,
    run: String,
    csv: String,
}

impl Example {
    fn new(columns: &[[&str; 3]], csv: &str) -> Self {
        let line = |[quantity, column, unit]: &[&str; 3]| {
            format!("{quantity} = {{ column = \"{column}\", unit = \"{unit}\" }}\n")
        };
        Example {
            dataset: String::new(),
            track: false,
            columns: columns.iter().map(line).collect(),
            run: String::new(),
            csv: csv.into(),
        }
    }

    fn load(&self) -> Result<Dataset, DatasetError> {
        let track = if self.track { "[track]\nfile='track.toml'\n" } else { "" };
        let manifest = format!(
            "[dataset]\nname='x'\n{}\n[train]\nfile='train.toml'\n{track}[columns]\n\
             time={{column='t',unit='s'}}\nspeed={{column='v',unit='m/s'}}\n{}\n\
             [[runs]]\nfile='1.csv'\n{}\n",
            self.dataset, self.columns, self.run
        );
        let files = [
            ("dataset.toml", manifest.as_str()),
            ("train.toml", TRAIN),
            ("track.toml", TRACK),
            ("1.csv", &self.csv),
        ];
        Dataset::load(&files[..])
    }

    fn run(&self) -> Run {
        self.load().unwrap().runs.remove(0)
    }
}

fn field(run: &Run, field: SampleField) -> Vec<Option<f64>> {
    run.samples.iter().map(|sample| sample.get(field)).collect()
}

#[test]
fn rows_become_samples_as_a_controller_would_publish_them() {
    let mut example = Example::new(
        &[
            ["position", "s", "km"],
            ["traction_force", "F", "kN"],
            ["brake_force", "B", "kN"],
            ["brake_cylinder_pressure", "p", "bar"],
            ["ambient_temperature", "T", "K"],
            ["acceleration", "a", "m/s2"],
            ["specific_force", "f", "m/s2"],
            ["curve_radius", "R", "m"],
            ["wheel_slide", "slide", "1"],
        ],
        "t,s,v,F,B,p,T,a,f,R,slide\n1000.2,1.5,20,35.5,0,1.2,293.15,0.1,0.2,-400,1\n\
         1000.4,1.504,20,,,,,,,inf,0\n",
    );
    example.run = "mass_t = 114.5\ndirection = -1".into();
    let run = example.run();
    let sample = run.samples[0];
    assert_eq!((sample.time_ns, sample.sequence, sample.run), (1_000_200_000_000, 1, 1));
    assert_eq!((sample.direction, sample.flags), (-1, dynocar_shared::sample::FLAG_WHEEL_SLIDE));
    let expected = [
        (SampleField::Position, 1500.0),
        (SampleField::Speed, 20.0),
        (SampleField::TractionForce, 35_500.0),
        (SampleField::BrakeForce, 0.0),
        (SampleField::BrakeCylinderPressure, 120_000.0),
        (SampleField::AmbientTemperature, 20.0),
        (SampleField::Acceleration, 0.1),
        (SampleField::SpecificForce, 0.2),
        (SampleField::CurveRadius, 400.0),
        (SampleField::Mass, 114_500.0),
    ];
    for (field, value) in expected {
        assert_eq!(sample.get(field), Some(value), "{field:?}");
    }
    assert_eq!(sample.get(SampleField::Gradient), None);
    let second = run.samples[1];
    assert_eq!((second.sequence, second.flags), (2, 0));
    assert_eq!(second.get(SampleField::TractionForce), None);
    assert_eq!(second.get(SampleField::CurveRadius), Some(0.0), "infinite: straight");
    assert_eq!(run.mass_kg, 114_500.0);
}

#[test]
fn the_mass_is_the_rows_then_the_runs_then_the_trains() {
    let mut example = Example::new(&[["train_mass", "m", "t"]], "t,v,m\n0,1,120\n1,1,\n");
    assert_eq!(field(&example.run(), SampleField::Mass), [Some(120e3), None]);
    assert_eq!(example.run().mass_kg, 100e3);
    example.run = "mass_t = 110".into();
    assert_eq!(field(&example.run(), SampleField::Mass), [Some(120e3), Some(110e3)]);
}

#[test]
fn what_a_sample_does_not_carry_is_kept_next_to_it() {
    let columns = [
        ["relative_humidity", "rh", "%"],
        ["wind_speed", "w", "km/h"],
        ["passengers", "n", "1"],
        ["altitude", "h", "m"],
    ];
    let run = Example::new(&columns, "t,v,rh,w,n,h\n0,1,93,36,250,512\n,,,,,\n2,1,,,,\n").run();
    assert_eq!(run.extra(Quantity::RelativeHumidity), Some(&vec![Some(0.93), None]));
    assert_eq!(run.extra(Quantity::WindSpeed), Some(&vec![Some(10.0), None]));
    // Who was counted stays on board until the next count.
    assert_eq!(run.extra(Quantity::Passengers), Some(&vec![Some(250.0), Some(250.0)]));
    assert_eq!(run.extra(Quantity::Altitude), Some(&vec![Some(512.0), None]));
    assert_eq!(Example::new(&[], "t,v\n0,1\n").run().extras, []);
}

#[test]
fn the_head_is_half_a_train_ahead_of_the_centre_in_either_direction() {
    let mut example = Example::new(&[["position", "s", "m"]], "t,v,s\n0,1,1000\n");
    example.dataset = "position_reference = 'head'".into();
    assert_eq!(field(&example.run(), SampleField::Position), [Some(960.0)]);
    example.run = "direction = -1".into();
    assert_eq!(field(&example.run(), SampleField::Position), [Some(1040.0)]);
}

#[test]
fn without_positions_they_are_integrated_and_the_run_says_so() {
    let mut example = Example::new(&[], "t,v\n5,0\n6,2\n7,4\n");
    let run = example.run();
    assert_eq!(run.position_source, PositionSource::IntegratedSpeed);
    assert_eq!(field(&run, SampleField::Position), [Some(0.0), Some(1.0), Some(4.0)]);
    example.track = true;
    assert!(example.run().diagnostics.iter().any(|it| it.code == "start_unknown"));
    example.run = "start_m = 700".into();
    assert_eq!(field(&example.run(), SampleField::Position)[2], Some(704.0));
    assert!(!example.run().diagnostics.iter().any(|it| it.code == "start_unknown"));
}

#[test]
fn the_gradients_source_goes_from_track_to_unknown() {
    let csv: String = (0..300)
        .map(|i| {
            format!("{i},10,0.2,{},{}\n", 0.03 * 10.0 * f64::from(i), if i == 7 { "" } else { "5" })
        })
        .collect();
    let csv = format!("t,v,f,h,i\n{csv}");
    let all =
        [["gradient", "i", "permille"], ["specific_force", "f", "m/s2"], ["altitude", "h", "m"]];
    let source = |columns: &[[&str; 3]], track: bool| {
        let mut example = Example::new(columns, &csv);
        example.track = track;
        example.run()
    };
    assert_eq!(source(&all, true).gradient_source, GradientSource::Track);
    let column = source(&all, false);
    assert_eq!(column.gradient_source, GradientSource::Column);
    assert_eq!(field(&column, SampleField::Gradient)[6..8], [Some(5.0), None]);
    let accelerometer = source(&all[1..], false);
    assert_eq!(accelerometer.gradient_source, GradientSource::SpecificForce);
    assert_eq!(field(&accelerometer, SampleField::Gradient)[100], None);
    let altitude = source(&all[2..], false);
    assert_eq!(altitude.gradient_source, GradientSource::Altitude);
    let slope = field(&altitude, SampleField::Gradient)[100].unwrap();
    assert!((slope - 30.0).abs() < 1e-9, "{slope}");
    let unknown = source(&[], false);
    assert_eq!(unknown.gradient_source, GradientSource::Unknown);
    assert!(unknown.diagnostics.iter().any(|it| it.code == "gradient_unknown"));
}

#[test]
fn an_altitude_climbs_with_the_chainage_also_when_the_train_runs_back() {
    let csv: String =
        (0..200).map(|i| format!("{i},10,{}\n", 0.02 * 10.0 * f64::from(i))).collect();
    let mut example = Example::new(&[["altitude", "h", "m"]], &format!("t,v,h\n{csv}"));
    example.run = "direction = -1".into();
    let slope = field(&example.run(), SampleField::Gradient)[50].unwrap();
    assert!(
        (slope + 20.0).abs() < 1e-9,
        "climbs along the travel, falls with the chainage: {slope}"
    );
}

#[test]
fn disorder_repetition_and_gaps_are_kept_counted_and_refused() {
    let csv = "t,v\n0,5\n1,5\n2,5\n2,5\n1.5,5\n3,5\n4,5\n,5\n6,5\n7,5\n12,5\n13,5\n14,5\n15,5\n";
    let run = Example::new(&[], csv).run();
    let quality = &run.quality;
    assert_eq!((quality.lines.rows, quality.rows_without_time, run.samples.len()), (14, 1, 13));
    assert_eq!((quality.order.out_of_order, quality.order.repeated), (1, 1));
    assert_eq!((quality.order.gaps, quality.order.longest_gap_s), (2, 5.0));
    assert_eq!(quality.order.missing_rows, 4, "before 12 s; 5 s has its row, without a time");
    let sequences: Vec<u64> = run.samples.iter().map(|sample| sample.sequence).collect();
    assert_eq!(sequences, [1, 2, 3, 4, 5, 6, 7, 9, 10, 15, 16, 17, 18]);
    let refused: Vec<_> = quality.refused.iter().map(|r| (r.reason, r.count)).collect();
    assert_eq!(refused, [(RejectionReason::TimeNotIncreasing, 2)]);
}

fn count_of(counts: &[quality::QuantityCount], quantity: Quantity) -> usize {
    counts.iter().find(|count| count.quantity == quantity).map_or(0, |count| count.count)
}

#[test]
fn missing_values_and_outliers_are_counted_by_quantity() {
    let csv: String = (0..60)
        .map(|i| {
            let speed = if i == 30 { 90.0 } else { 10.0 };
            let force = match i {
                20 => "900".into(),
                40..50 => String::new(),
                _ => format!("{}", 20 + i % 3),
            };
            format!("{},{speed},{force},0\n", 0.2 * f64::from(i))
        })
        .collect();
    let columns = [["traction_force", "F", "kN"], ["brake_force", "B", "kN"]];
    let run = Example::new(&columns, &format!("t,v,F,B\n{csv}")).run();
    let quality = &run.quality;
    assert_eq!(count_of(&quality.missing, Quantity::TractionForce), 10);
    assert_eq!(count_of(&quality.missing, Quantity::BrakeForce), 0);
    assert_eq!(count_of(&quality.outliers, Quantity::Speed), 1);
    assert_eq!(count_of(&quality.outliers, Quantity::TractionForce), 1);
    assert_eq!(quality.speed_range_mps, Some((10.0, 10.0)));
    assert!((quality.distance_m - 118.0).abs() < 1e-9, "the spike does not count");
    assert_eq!(quality.refused_in_all(), 2);
}

#[test]
fn the_phases_add_up_to_the_duration() {
    let csv = "t,v,F,B\n0,0,0,50\n1,0,0,50\n2,1,60,0\n3,2,60,0\n4,3,0.1,0\n5,3,0,0\n6,3,,\n7,2,0,80\n\
               8,1,0,80\n9,0,0,80\n10,0,0,80\n15,0,0,80\n16,0,0,80\n";
    let columns = [["traction_force", "F", "kN"], ["brake_force", "B", "kN"]];
    let phases = Example::new(&columns, csv).run().quality.phases;
    let expected = Phases {
        standstill_s: 4.0,
        coasting_s: 2.0,
        traction_s: 2.0,
        braking_s: 2.0,
        unknown_s: 6.0,
    };
    assert_eq!(phases, expected);
}

#[test]
fn likely_mistakes_are_diagnosed() {
    let csv: String =
        (0..100).map(|i| format!("{i},36,{},-80\n", 5000.0 - 10.0 * f64::from(i))).collect();
    let columns = [["position", "s", "m"], ["brake_force", "B", "kN"]];
    let mut example = Example::new(&columns, &format!("t,v,s,B\n{csv}"));
    example.track = true;
    let diagnostics: Vec<String> =
        example.run().diagnostics.iter().map(ToString::to_string).collect();
    let expected = [
        "the position changes by -990 m in all, against direction = 1",
        "the position covers 990 m, the integrated speed 3564 m (ratio 0.278): are the units of \
         time, position and speed right?",
        "no traction_force is mapped: without it the balance of forces is not known",
        "brake_force is below zero in 100 rows, down to -80000 N, and those samples are refused: a \
         signed force is a control_force, a negative retarding one needs scale = -1",
    ];
    assert_eq!(diagnostics, expected);
}

#[test]
fn a_run_that_goes_out_and_comes_back_is_to_be_divided() {
    let row = |i: i32| format!("{i},10,{}\n", 5000 + 10 * (if i < 120 { i } else { 240 - i }));
    let run_of = |rows: std::ops::Range<i32>| {
        let csv = format!("t,v,s\n{}", rows.map(row).collect::<String>());
        Example::new(&[["position", "s", "m"]], &csv).run()
    };
    let found = |rows| {
        let run = run_of(rows);
        let codes = run.diagnostics.iter().map(|it| (it.code, it.text.clone()));
        codes.filter(|(code, _)| ["turns_back", "distance_mismatch"].contains(code)).collect()
    };
    let text = "the train goes to 6200 m and back, but a run has one direction: make a file of each \
                way, with its own direction";
    let expected = vec![("turns_back", text.to_string())];
    for rows in [0..240, 0..200, 60..240] {
        let turned: Vec<(&str, String)> = found(rows);
        assert_eq!(turned, expected);
    }
    assert_eq!(found(0..120), []);
}

#[test]
fn a_file_that_breaks_off_within_a_line_is_diagnosed() {
    let breaks_off = |csv: &str| {
        let run = Example::new(&[], csv).run();
        run.diagnostics.iter().any(|diagnostic| diagnostic.code == "breaks_off")
    };
    assert!(breaks_off("t,v\n0,1\n0.1,1\n0.2,1\n0."));
    assert!(!breaks_off("t,v\n0,1\n0.1,1\n0.2,1\n"));
}

#[test]
fn a_recorder_that_hangs_while_the_train_moves_is_diagnosed() {
    let diagnostics = |hangs_at: &dyn Fn(u32) -> bool, stands: bool| -> Vec<String> {
        let mut csv = String::from("t,v,F,B\n");
        let (mut speed_mps, mut force_kn) = (16.0, 30.0);
        for row in 0..600_u32 {
            if !hangs_at(row) && !stands {
                speed_mps += if row % 3 == 0 { -0.01 } else { 0.01 };
                force_kn += if row % 2 == 0 { 0.3 } else { -0.2 };
            }
            let shown = if stands { 0.0 } else { speed_mps };
            csv += &format!("{},{shown},{force_kn},0\n", 0.1 * f64::from(row));
        }
        let columns = [["traction_force", "F", "kN"], ["brake_force", "B", "kN"]];
        let run = Example::new(&columns, &csv).run();
        let diagnostics = run.diagnostics.iter().map(ToString::to_string);
        diagnostics.filter(|diagnostic| diagnostic.contains("every column")).collect()
    };
    let hung = diagnostics(&|row| row > 300, false);
    assert_eq!(hung.len(), 1, "{hung:?}");
    let expected = "from 30 s every column but the time keeps its value for 29.9 s, at 17.0 m/s: ";
    assert!(hung[0].starts_with(expected), "{hung:?}");
    assert_eq!(
        diagnostics(&|row| (300..390).contains(&row), false),
        [] as [String; 0],
        "nine seconds"
    );
    assert_eq!(diagnostics(&|_| false, true), [] as [String; 0], "a train at a stop");
}

#[test]
fn a_handle_without_its_curve_is_refused_where_it_is_mapped() {
    let example = Example::new(&[["brake_handle", "h", "1"]], "t,v,h\n0,1,0\n");
    assert_eq!(
        example.load().unwrap_err().to_string(),
        "dataset.toml:9: brake_handle is a share of the effort curve, but train.toml has no \
         [brake] max_force_kn or effort"
    );
    let run = Example::new(&[["traction_handle", "h", "%"]], "t,v,h\n0,15,50\n").run();
    assert_eq!(field(&run, SampleField::TractionForce), [Some(35_000.0)]);
    assert_eq!(run.traction_source, ForceSource::Handle);
}

#[test]
fn a_file_that_cannot_be_had_is_named_where_it_is_listed() {
    let mut example = Example::new(&[], "t,v\n0,1\n");
    example.run = "[[runs]]\nfile='2.csv'".into();
    assert_eq!(example.load().unwrap_err().to_string(), "dataset.toml:12: 2.csv: no such file");
    let none: [(&str, &str); 0] = [];
    let error = Dataset::load(&none[..]).unwrap_err();
    assert_eq!(error.to_string(), "dataset.toml: no such file");
}

#[test]
fn a_run_without_any_time_is_refused() {
    let error = Example::new(&[], "t,v\n,1\n,2\n").load().unwrap_err();
    assert_eq!(
        error.to_string(),
        "1.csv: column 't': expected values of time, found none in 2 rows"
    );
}

#[test]
fn runs_are_numbered_and_distinguished_by_role() {
    let files = [
        (
            "dataset.toml",
            "[dataset]\nname='x'\n[train]\nfile='t'\n[columns]\ntime={column='t',unit='ms'}\n\
             speed={column='v',unit='km/h'}\n[[runs]]\nfile='a'\n[[runs]]\nfile='b'\n\
             role='holdout'\n",
        ),
        ("t", TRAIN),
        ("a", "t,v\n0,36\n"),
        ("b", "\u{feff}\"t\";\"v\"\r\n"),
    ];
    let head = DatasetHead::open(&files[..]).unwrap();
    let run = head.read_run(&files[..], 0).unwrap();
    assert_eq!((run.number, run.role, run.samples[0].speed_mps), (1, Role::Fit, 10.0));
    assert!(head.read_run(&files[..], 1).is_err(), "each run is read on its own");
    let good = [files[0], files[1], files[2], ("b", "t,v\n0,72\n")];
    let dataset = Dataset::load(&good[..]).unwrap();
    let holdout: Vec<_> = dataset.with_role(Role::Holdout).map(|run| run.number).collect();
    assert_eq!((holdout, dataset.runs[1].samples[0].run), (vec![2], 2));
}
