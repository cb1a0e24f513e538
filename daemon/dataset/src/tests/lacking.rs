//! Runs without what makes a run.

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
        let mapped = [("control_force", "F", "kN")];
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
