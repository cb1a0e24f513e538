//! Runs that lack essential contents.

use super::*;

#[test]
fn a_run_without_any_speed_or_with_one_time_only_is_refused() {
    for cells in ["NaN", "", "inf", "1e308"] {
        let error = Example::new(&[], &format!("t,v\n0,{cells}\n1,{cells}\n")).load().unwrap_err();
        let words = "1.csv: column 'v': expected values of speed, found none in 2 rows";
        assert_eq!(error.to_string(), words);
    }
    let error = Example::new(&[], "t,v\n5,1\n5,2\n1e300,3\n").load().unwrap_err();
    let words = "1.csv: column 't': expected times that grow, found 5 s in all 2 rows";
    assert_eq!(error.to_string(), words);
}

#[test]
fn what_a_run_lacks_altogether_is_diagnosed() {
    let diagnostics = |csv: &str| {
        let mapped = [["control_force", "F", "kN"]];
        let run = Example::new(&mapped, csv).run();
        run.diagnostics.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let empty = diagnostics("t,v,F\n0,1,NaN\n1,2,1e308\n");
    assert!(empty.contains("control_force is mapped, but no row has a value of it"), "{empty}");
    let standing = diagnostics("t,v,F\n0,0,0\n1,0.02,1\n");
    assert!(standing.contains("the train hardly moves, at 0.02 m/s at most"), "{standing}");
    let single = diagnostics("t,v,F\n0,10,0\n");
    assert!(single.contains("only one row is in order of time"), "{single}");
    let driven = diagnostics("t,v,F\n0,10,0\n1,10.1,1\n");
    assert!(!["mapped", "hardly", "only"].iter().any(|word| driven.contains(word)), "{driven}");
}

#[test]
fn under_traction_only_a_brake_that_is_not_recorded_or_wrong_spoils_nothing() {
    let traction = ["traction_force", "F", "kN"];
    let brake = ["brake_force", "B", "kN"];
    let forces = |mapped: &[[&str; 3]], csv: &str| {
        let mut dataset = Example::new(mapped, csv).load().unwrap();
        dataset.keep_traction_only();
        let of = |field| dataset.runs[0].samples.iter().map(|it| it.get(field)).collect::<Vec<_>>();
        (of(SampleField::TractionForce), of(SampleField::BrakeForce))
    };
    let with = forces(&[traction, brake], "t,v,F,B\n0,10,30,0\n1,10,0,0\n2,9,0,50\n3,9,20,0\n");
    let without = forces(&[traction], "t,v,F\n0,10,30\n1,10,0\n2,9,0\n3,9,20\n");
    assert_eq!(with, without, "as with a column of zeros");
    assert_eq!(with.0, [Some(30e3), None, None, Some(20e3)]);
    assert_eq!(with.1, [Some(0.0), None, None, Some(0.0)]);
}

#[test]
fn columns_that_add_up_are_one_force() {
    let csv = "t,v,A,B,C\n0,10,30,20,5\n1,10,0,0,0\n2,9,1,,2\n3,9,n/a,2,3\n";
    let mut example = Example::new(&[], csv);
    example.columns = "traction_force = { column = ['A', 'B', 'C'], unit = 'kN' }\n".into();
    let forces: Vec<_> =
        example.run().samples.iter().map(|it| it.get(SampleField::TractionForce)).collect();
    assert_eq!(forces, [Some(55e3), Some(0.0), None, None]);
    for (columns, words) in [
        ("traction_force = { column = ['A', 'A'], unit = 'kN' }\n", "is named twice"),
        ("traction_force = { column = ['A', 'X'], unit = 'kN' }\n", "unknown column 'X'"),
        ("gradient = { column = ['A', 'B'], unit = '%' }\n", "expected"),
    ] {
        example.columns = columns.into();
        let refused = example.load().unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
    example.columns = "traction_force = { column = 'A', unit = 'kN', doubtful = true }\n".into();
    let run = example.run();
    assert!(run.diagnostics.iter().any(|it| it.code == "doubtful_input"), "{:?}", run.diagnostics);
}
