//! Samples and snapshots come back from messages to the bit.

use dynocar_shared::SampleField;
use proptest::prelude::*;

use dynocar_mcap::topic::{
    CodecError, decode_sample, decode_snapshot, encode_sample, encode_snapshot,
};
use dynocar_shared::layout::Words;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

/// A struct with any bits in every field.
fn filled<T: Words>(mut it: T, words: &[u64]) -> T {
    (0..it.count()).for_each(|index| it.set_word(index, words[index % words.len()]));
    it
}

fn same_bits(one: &impl Words, other: &impl Words) -> bool {
    (0..one.count()).all(|index| one.word(index) == other.word(index))
}

proptest! {
    #[test]
    fn any_sample_comes_back_to_the_bit(words in prop::collection::vec(any::<u64>(), 19)) {
        let mut sample = filled(TrainSample::empty(TrainId(1)), &words);
        sample.valid &= 0x7ff;
        let mut message = Vec::new();
        encode_sample(&sample, &mut message);
        let mut expected = sample;
        for field in SampleField::ALL.into_iter().filter(|&it| sample.get(it).is_none()) {
            expected.set(field, 0.0);
        }
        expected.valid = sample.valid;
        prop_assert!(same_bits(&decode_sample(&message).unwrap(), &expected));
    }

    #[test]
    fn any_snapshot_comes_back_to_the_bit(
        words in prop::collection::vec(prop_oneof![Just(0), any::<u64>()], 100),
    ) {
        let snapshot = filled(ParameterSnapshot::empty(), &words);
        let mut message = Vec::new();
        encode_snapshot(&snapshot, &mut message);
        prop_assert!(same_bits(&decode_snapshot(&message).unwrap(), &snapshot));
    }

    #[test]
    fn any_bytes_are_a_message_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
        let _ = decode_sample(&bytes);
        let _ = decode_snapshot(&bytes);
    }
}

#[test]
fn a_message_that_is_cut_off_or_of_other_types_is_refused_by_name() {
    let mut message = Vec::new();
    let sample = TrainSample::empty(TrainId(1)).with(SampleField::CurveRadius, 300.0);
    encode_sample(&sample, &mut message);
    let error = decode_sample(&message[..message.len() - 1]).unwrap_err();
    assert_eq!(error, CodecError::CutOff { field: "curve_radius_m" });
    let error = decode_snapshot(&[0x09, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap_err();
    assert!(error.to_string().starts_with("epoch: expected u64"), "{error}");
}
