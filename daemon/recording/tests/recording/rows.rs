//! Samples come back from rows of CSV to the bit.

use dynocar_shared::SampleField;
use proptest::prelude::*;

use dynocar_recording::convert::{from_rows, is_rows, to_rows};
use dynocar_shared::layout::Words;
use dynocar_shared::{TrainId, TrainSample};

proptest! {
    #[test]
    fn any_samples_come_back_to_the_bit(
        words in prop::collection::vec(prop::collection::vec(any::<u64>(), 19), 0..4),
    ) {
        let samples: Vec<TrainSample> = words
            .iter()
            .map(|words| {
                let mut sample = TrainSample::empty(TrainId(1));
                words.iter().enumerate().for_each(|(index, &it)| sample.set_word(index, it));
                let kept = sample.valid;
                for field in SampleField::ALL {
                    match sample.get(field) {
                        None => sample.set(field, 0.0),
                        Some(value) if value.is_nan() => sample.set(field, f64::NAN),
                        Some(_) => {}
                    }
                }
                sample.valid = kept & 0x7ff;
                sample
            })
            .collect();
        let text = to_rows(&samples);
        prop_assert!(is_rows(&text));
        let back = from_rows("run.csv", &text).unwrap();
        prop_assert_eq!(back.len(), samples.len());
        for (one, other) in back.iter().zip(&samples) {
            for index in 0..one.count() {
                prop_assert_eq!(one.word(index), other.word(index), "word {}", index);
            }
        }
    }
}

#[test]
fn a_cell_that_is_no_number_is_named() {
    let text = to_rows(&[TrainSample::empty(TrainId(1))]).replace("\n0,", "\nnow,");
    let error = from_rows("runs/001.csv", &text).unwrap_err().to_string();
    assert_eq!(error, "runs/001.csv:2: time_ns = \"now\": expected a number of type i64");
}
