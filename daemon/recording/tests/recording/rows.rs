//! Samples come back from rows of CSV to the bit.

use std::path::Path;

use dynocar_shared::SampleField;
use proptest::prelude::*;

use dynocar_analysis::dataset::{Dataset, DatasetFiles};
use dynocar_mcap::recording::Recording;
use dynocar_shared::layout::Words;
use dynocar_shared::{TrainId, TrainSample};
use dynocar_workshop::convert::{ModelFiles, dataset_of, from_rows, is_rows, to_rows};

use crate::support::config_folder;

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

/// Any number, and those that trains have.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(-0.0), 0.0..60.0, any::<f64>()]
}

proptest! {
    #[test]
    fn any_samples_are_the_same_run_from_memory_and_from_the_text_of_their_rows(
        rows in prop::collection::vec((prop::collection::vec(number(), 11), any::<u16>()), 1..30),
    ) {
        let train = std::fs::read(config_folder().join("demo/train.toml")).unwrap();
        let sample = |(index, (values, bits)): (usize, &(Vec<f64>, u16))| {
            let mut sample = TrainSample::empty(TrainId(1));
            (sample.time_ns, sample.sequence) = (index as i64 * 200_000_001, index as u64 + 1);
            SampleField::ALL.iter().zip(values).for_each(|(&it, &value)| sample.set(it, value));
            sample.valid = bits & 0x7ff | SampleField::Speed.bit();
            sample.flags = (bits >> 15) as u8;
            sample
        };
        let recording = Recording {
            samples: rows.iter().enumerate().map(sample).collect(),
            attachments: vec![("configuration-1/train-1.toml".into(), train)],
            ..Recording::default()
        };
        let path = Path::new("run.mcap");
        let (memory, _) = dataset_of(path, recording, None, &ModelFiles::default()).unwrap();
        let texts: Vec<(String, String)> =
            memory.names().map(|it| (it.to_owned(), memory.read(it).unwrap())).collect();
        let texts: Vec<(&str, &str)> = texts.iter().map(|it| (&it.0[..], &it.1[..])).collect();
        // Compared as text, since a missing value is no number.
        let [one, other] = [Dataset::load(&memory), Dataset::load(&texts[..])]
            .map(|it| it.map(|it| format!("{it:?}")).map_err(|it| it.words));
        prop_assert_eq!(one, other);
    }
}

#[test]
fn a_cell_that_is_no_number_is_named() {
    let text = to_rows(&[TrainSample::empty(TrainId(1))]).replace("\n0,", "\nnow,");
    let error = from_rows("runs/001.csv", &text).unwrap_err().to_string();
    assert_eq!(error, "runs/001.csv:2: time_ns = \"now\": expected a number of type i64");
}
