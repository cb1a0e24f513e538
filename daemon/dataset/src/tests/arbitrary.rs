//! Files with arbitrary contents.

use proptest::prelude::*;

use super::*;

/// Pieces of the formats, in any order: likelier to get far than random letters.
fn pieces() -> impl Strategy<Value = String> {
    let words = [
        "[dataset]",
        "[train]",
        "[[runs]]",
        "[columns]",
        "[track]",
        "\n",
        "\n",
        " = ",
        "name",
        "file",
        "gradient",
        "curves",
        "effort",
        "mass_t",
        "[",
        "]",
        "[[",
        "]]",
        ",",
        "\"",
        "{",
        "}",
        "unit",
        "column",
        "1",
        "-3.5",
        "nan",
        "inf",
        "1e400",
        "0x1F",
        "true",
        "\"x\"",
        "1979-05-27",
        "ü",
        "\r",
        "\u{feff}",
        "#",
    ];
    let word = prop::sample::select(words.to_vec());
    prop::collection::vec(word, 0..60).prop_map(|words| words.concat())
}

fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => (-1e3..1e3f64).prop_map(|x| x.to_string()),
        1 => any::<f64>().prop_map(|x| x.to_string()),
        1 => Just(String::new()),
        1 => Just("NaN".into()),
    ]
}

proptest! {
    #[test]
    fn text_never_panics_the_readers(text in prop_oneof![pieces(), any::<String>()]) {
        let _ = Manifest::parse("d", &text);
        let _ = parse_train("t", &text);
        let _ = parse_track("l", &text);
        let mut example = Example::new(&[["position", "s", "m"]], &text);
        let _ = example.load();
        example.csv = format!("t,v,s\n{text}");
        let _ = example.load();
    }

    #[test]
    fn rows_of_numbers_always_load_and_carry_no_nan(
        rows in prop::collection::vec(prop::collection::vec(cell(), 6), 1..40),
        direction in prop::bool::ANY,
    ) {
        let columns = [
            ["position", "s", "km"], ["control_force", "F", "MN"], ["altitude", "h", "m"],
            ["curve_radius", "R", "m"],
        ];
        let rows: Vec<String> = rows.iter().map(|cells| cells.join(",")).collect();
        let csv = format!("t,v,s,F,h,R\n0,{}", &rows.join("\n").split_once(',').unwrap().1);
        let mut example = Example::new(&columns, &format!("{csv}\n"));
        example.track = direction;
        example.run = format!("direction = {}", if direction { 1 } else { -1 });
        let run = match example.load() {
            Ok(mut dataset) => dataset.runs.remove(0),
            Err(error) => {
                // Rows without a speed, or of one time.
                let is_lacking = ["expected values of", "expected times that grow"]
                    .iter()
                    .any(|words| error.words.contains(words));
                prop_assert!(is_lacking, "{error}");
                return Ok(());
            }
        };
        prop_assert!(run.samples.len() == run.quality.samples());
        for sample in &run.samples {
            for field in SampleField::ALL {
                prop_assert!(sample.get(field).is_none_or(f64::is_finite), "{field:?}");
            }
        }
        prop_assert!(run.samples.windows(2).all(|pair| pair[0].sequence < pair[1].sequence));
    }
}
