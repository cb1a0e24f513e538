//! Faults of whole columns and of runs that hold the same.

use super::*;

/// Returns a run of 400 s at 5 Hz, with a gradient and a position by time in s.
fn driven(gradient: impl Fn(f64) -> f64, position_m: impl Fn(f64, f64) -> f64) -> Example {
    let mut true_m = 1000.0;
    let row = |fifth: u32| {
        let time_s = 0.2 * f64::from(fifth);
        let speed_mps = 15.0 + 5.0 * (0.05 * time_s).sin();
        true_m += 0.2 * speed_mps;
        format!(
            "{time_s:.1},{speed_mps:.3},{},{:.1}\n",
            gradient(time_s),
            position_m(time_s, true_m)
        )
    };
    let csv = "t,v,i,s\n".to_owned() + &(0..2000).map(row).collect::<String>();
    Example::new(&[["gradient", "i", "permille"], ["position", "s", "m"]], &csv)
}

fn texts(run: &Run, code: &str) -> Vec<String> {
    run.diagnostics.iter().filter(|it| it.code == code).map(ToString::to_string).collect()
}

#[test]
fn a_number_in_the_place_of_missing_values_is_named_and_not_used() {
    let slope = |time_s: f64| (6.0 * (0.01 * time_s).sin()).round();
    let filled = |time_s: f64| if time_s % 10.0 < 0.9 { 99.0 } else { slope(time_s) };
    let run = driven(filled, |time_s, true_m| if time_s < 40.0 { 0.0 } else { true_m }).run();
    let named = texts(&run, "fill_value");
    assert_eq!(
        named,
        [
            "column 'i' holds 99 in 200 rows, apart from its other values, -5 to 6: taken for missing values of \
             gradient; leave such cells empty in the file",
            "column 's' holds 0 in 200 rows, apart from its other values, 1745.1 to 7058.7: taken for missing values \
             of position; leave such cells empty in the file",
        ]
    );
    let missing = |of| field(&run, of).iter().filter(|it| it.is_none()).count();
    assert_eq!((missing(SampleField::Gradient), missing(SampleField::Position)), (200, 200));
    assert!(
        texts(&run, "distance_mismatch").is_empty() && texts(&run, "chainage_break").is_empty()
    );
    assert!(texts(&driven(slope, |_, true_m| true_m).run(), "fill_value").is_empty());
}

#[test]
fn a_break_of_the_chainage_is_named_and_no_other_unit() {
    let run =
        driven(|_| 0.0, |time_s, true_m| true_m + if time_s < 200.0 { 0.0 } else { 800.0 }).run();
    let named = texts(&run, "chainage_break");
    assert!(named[0].starts_with("the position jumps by 800 m in line 1002: "), "{named:?}");
    assert!(texts(&run, "distance_mismatch").is_empty());
}

#[test]
fn curves_narrower_than_any_track_are_named() {
    let csv: String = (0..100).map(|second| format!("{second},10,0.6\n")).collect();
    let example = Example::new(&[["curve_radius", "R", "m"]], &format!("t,v,R\n{csv}"));
    let named = texts(&example.run(), "narrow_curve");
    let expected = "curve_radius lies below 10 m in 100 rows, down to 0.6 m, where no track is: is the unit km?";
    assert_eq!(named, [expected]);
}

#[test]
fn a_chainage_of_km_and_m_is_refused_with_the_remedy() {
    let example = Example::new(&[["position", "s", "m"]], "t,v,s\n0,1,12+345\n1,1,12+346.5\n");
    let refused = example.load().unwrap_err().to_string();
    assert!(
        refused.contains("write a chainage of km and m as metres: 12345 for 12+345"),
        "{refused}"
    );
}

#[test]
fn a_run_that_holds_the_motion_of_another_is_named() {
    let run = |shift: i32, scale: f64| -> String {
        let row = |row: i32| format!("{},{}\n", row + shift, scale * f64::from(row % 30));
        "t,v\n".to_owned() + &(0..200).map(row).collect::<String>()
    };
    let codes = |texts: [&str; 3], last_role: &str| -> Vec<(&'static str, Vec<String>)> {
        let manifest = format!(
            "[dataset]\nname='x'\n[train]\nfile='train.toml'\n[columns]\ntime={{column='t',unit='s'}}\n\
             speed={{column='v',unit='m/s'}}\n[[runs]]\nfile='0.csv'\n[[runs]]\nfile='1.csv'\n\
             [[runs]]\nfile='2.csv'\nrole='{last_role}'\n"
        );
        let files = [
            ("dataset.toml", &manifest[..]),
            ("train.toml", TRAIN),
            ("0.csv", texts[0]),
            ("1.csv", texts[1]),
            ("2.csv", texts[2]),
        ];
        let found = Dataset::load(&files[..]).unwrap().diagnostics().into_iter();
        found.filter(|it| it.code == "copied_run").map(|it| (it.code, it.runs)).collect()
    };
    let (one, later, other) = (run(0, 1.0), run(1000, 1.0), run(0, 1.1));
    assert_eq!(codes([&one, &other, &run(0, 0.9)], "holdout"), []);
    let copied = vec![("copied_run", vec!["0.csv".to_owned(), "2.csv".to_owned()])];
    for role in ["holdout", "fit"] {
        assert_eq!(codes([&one, &other, &later], role), copied, "{role}");
    }
    let standing = "t,v\n0,0\n1,0\n2,0\n";
    assert_eq!(codes([standing, standing, standing], "holdout"), []);
}
