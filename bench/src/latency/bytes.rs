//! Samples and snapshots as the bytes that a socket carries.

use dynocar_client::channel::Payload;

/// The bytes of a payload.
pub fn as_bytes<T: Payload>(payload: &T) -> &[u8] {
    // SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it
    // is compiled), so that every one of its bytes is initialised.
    unsafe { std::slice::from_raw_parts(std::ptr::from_ref(payload).cast(), size_of::<T>()) }
}

/// A payload from its bytes; `None` when they are too few or too many.
pub fn from_bytes<T: Payload>(bytes: &[u8]) -> Option<T> {
    if bytes.len() != size_of::<T>() {
        return None;
    }
    // SAFETY: the length is right, every pattern of bytes is a value of a struct of plain
    // numbers, and the read does not ask for alignment.
    Some(unsafe { std::ptr::read_unaligned(bytes.as_ptr().cast()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::{SampleField, TrainId, TrainSample};

    #[test]
    fn a_sample_survives_its_bytes() {
        let sample = TrainSample::empty(TrainId(7)).with(SampleField::Speed, 21.5);
        assert_eq!(from_bytes::<TrainSample>(as_bytes(&sample)), Some(sample));
        assert_eq!(from_bytes::<TrainSample>(&as_bytes(&sample)[1..]), None);
    }
}
