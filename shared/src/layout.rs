//! Descriptions of the bytes of shared-memory types.
//!
//! [`wire_struct!`](crate::wire_struct) declares a `#[repr(C)]` struct, refuses padding at compile time, and gives the
//! struct a `LAYOUT` (name, type, offset and size of each field) and a `LAYOUT_HASH` over it, and, for programs that
//! write the struct down, the meanings of the fields and access to their words by index. Two peers whose hashes differ
//! never exchange a byte: the hash is part of the type name that the channel compares before it maps anything.

/// One field of a shared-memory type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldLayout {
    /// The field's name, with its unit.
    pub name: &'static str,
    /// The field's Rust type.
    pub type_name: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// Bytes the field takes.
    pub size: usize,
}

/// A field as words of 64 bits: a number is one, an array as many as it has entries.
///
/// A float's word holds its bits, an integer's its value, negative ones in two's complement.
pub trait Words {
    /// Returns the number of words.
    fn count(&self) -> usize;
    /// Returns a word by its index.
    ///
    /// # Panics
    ///
    /// If there is no such word.
    fn word(&self, index: usize) -> u64;
    /// Sets a word by its place; an integer keeps the bits that it has room for.
    ///
    /// # Panics
    ///
    /// If there is no such word.
    fn set_word(&mut self, index: usize, word: u64);
}

macro_rules! words {
    ($($ty:ty: $value:ident => $to:expr, $word:ident => $from:expr;)*) => { $(
        impl Words for $ty {
            fn count(&self) -> usize {
                1
            }
            fn word(&self, _: usize) -> u64 {
                let $value = *self;
                $to
            }
            fn set_word(&mut self, _: usize, $word: u64) {
                *self = $from;
            }
        }
    )* };
}

words! {
    u8: value => u64::from(value), word => word as u8;
    u16: value => u64::from(value), word => word as u16;
    u32: value => u64::from(value), word => word as u32;
    u64: value => value, word => word;
    i8: value => value as u64, word => word as i8;
    i64: value => value as u64, word => word as i64;
    f64: value => value.to_bits(), word => f64::from_bits(word);
}

impl<T: Words, const N: usize> Words for [T; N] {
    fn count(&self) -> usize {
        N
    }
    fn word(&self, index: usize) -> u64 {
        self[index].word(0)
    }
    fn set_word(&mut self, index: usize, word: u64) {
        self[index].set_word(0, word);
    }
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

const fn hash_bytes(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(FNV_PRIME);
        i += 1;
    }
    hash
}

/// 64-bit FNV-1a over the struct's name, its size and every field's name, type, offset and size.
pub const fn layout_hash(struct_name: &str, size: usize, fields: &[FieldLayout]) -> u64 {
    let mut hash = hash_bytes(FNV_OFFSET, struct_name.as_bytes());
    hash = hash_bytes(hash, &(size as u64).to_le_bytes());
    let mut i = 0;
    while i < fields.len() {
        hash = hash_bytes(hash, fields[i].name.as_bytes());
        hash = hash_bytes(hash, b":");
        hash = hash_bytes(hash, fields[i].type_name.as_bytes());
        hash = hash_bytes(hash, &(fields[i].offset as u64).to_le_bytes());
        hash = hash_bytes(hash, &(fields[i].size as u64).to_le_bytes());
        i += 1;
    }
    hash
}

/// Returns whether the fields, in order, fill `size` bytes without a gap.
pub const fn is_without_padding(size: usize, fields: &[FieldLayout]) -> bool {
    let mut end = 0;
    let mut i = 0;
    while i < fields.len() {
        if fields[i].offset != end {
            return false;
        }
        end += fields[i].size;
        i += 1;
    }
    end == size
}

/// Returns the sixteen lower-case hexadecimal digits of a hash, for use inside a constant name.
pub const fn hex_digits(hash: u64) -> [u8; 16] {
    let mut digits = [0u8; 16];
    let mut i = 0;
    while i < 16 {
        let nibble = ((hash >> (60 - 4 * i)) & 0xf) as u8;
        digits[i] = if nibble < 10 { b'0' + nibble } else { b'a' + nibble - 10 };
        i += 1;
    }
    digits
}

/// Declares a shared-memory struct: `#[repr(C)]`, no padding, with `LAYOUT`, `MEANINGS`,
/// `LAYOUT_HASH` and the `WIRE_NAME` that a channel compares (`dynocar.<Struct>.<hash>`).
#[macro_export]
macro_rules! wire_struct {
    ($(#[$meta:meta])* pub struct $name:ident {
        $( $(#[doc = $doc:literal])* pub $field:ident : $ty:ty ),* $(,)?
    }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $( $(#[doc = $doc])* pub $field: $ty ),* }

        impl $name {
            /// Name, type, offset and size of each field, in order.
            pub const LAYOUT: &'static [$crate::layout::FieldLayout] = &[
                $( $crate::layout::FieldLayout {
                    name: stringify!($field),
                    type_name: stringify!($ty),
                    offset: ::core::mem::offset_of!($name, $field),
                    size: ::core::mem::size_of::<$ty>(),
                } ),*
            ];
            /// Meaning of each field, in the order of `LAYOUT`, from its documentation.
            pub const MEANINGS: &'static [&'static str] = &[ $( concat!($($doc),*) ),* ];
            /// Hash over the layout; peers with different hashes are incompatible.
            pub const LAYOUT_HASH: u64 = $crate::layout::layout_hash(
                stringify!($name), ::core::mem::size_of::<$name>(), Self::LAYOUT);
            /// The type's name on the channel, layout hash included.
            pub const WIRE_NAME: &'static str = {
                const PREFIX: &[u8] = concat!("dynocar.", stringify!($name), ".").as_bytes();
                const BYTES: [u8; PREFIX.len() + 16] = {
                    let mut bytes = [0u8; PREFIX.len() + 16];
                    let digits = $crate::layout::hex_digits($name::LAYOUT_HASH);
                    let mut i = 0;
                    while i < PREFIX.len() { bytes[i] = PREFIX[i]; i += 1; }
                    let mut j = 0;
                    while j < 16 { bytes[PREFIX.len() + j] = digits[j]; j += 1; }
                    bytes
                };
                match ::core::str::from_utf8(&BYTES) {
                    Ok(name) => name,
                    Err(_) => panic!("a wire name is ASCII"),
                }
            };

            /// Returns every field by its place in `LAYOUT`.
            pub fn fields(&self) -> [&dyn $crate::layout::Words; $name::LAYOUT.len()] {
                [ $( &self.$field ),* ]
            }

            /// Returns every field by its place in `LAYOUT`, to be set.
            pub fn fields_mut(&mut self) -> [&mut dyn $crate::layout::Words; $name::LAYOUT.len()] {
                [ $( &mut self.$field ),* ]
            }
        }

        impl $crate::layout::Words for $name {
            fn count(&self) -> usize {
                self.fields().iter().map(|field| field.count()).sum()
            }
            fn word(&self, mut index: usize) -> u64 {
                for field in self.fields() {
                    if index < field.count() {
                        return field.word(index);
                    }
                    index -= field.count();
                }
                panic!("no such word")
            }
            fn set_word(&mut self, mut index: usize, word: u64) {
                for field in self.fields_mut() {
                    if index < field.count() {
                        return field.set_word(index, word);
                    }
                    index -= field.count();
                }
                panic!("no such word")
            }
        }

        const _: () = assert!(
            $crate::layout::is_without_padding(::core::mem::size_of::<$name>(), $name::LAYOUT),
            concat!(stringify!($name), " has padding")
        );
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    wire_struct! {
        /// Two words.
        pub struct Pair {
            /// First.
            pub first: u64,
            /// Second.
            pub second_mps: f64,
        }
    }

    #[test]
    fn layout_lists_every_field_with_its_offset() {
        assert_eq!(Pair::LAYOUT.len(), 2);
        assert_eq!((Pair::LAYOUT[1].name, Pair::LAYOUT[1].offset), ("second_mps", 8));
    }

    #[test]
    fn every_word_is_read_and_set_by_its_place() {
        let mut pair = Pair { first: 7, second_mps: -0.5 };
        assert_eq!((pair.count(), pair.word(0), pair.word(1)), (2, 7, (-0.5f64).to_bits()));
        pair.set_word(1, 2.5f64.to_bits());
        pair.fields_mut()[0].set_word(0, u64::MAX);
        assert_eq!(pair, Pair { first: u64::MAX, second_mps: 2.5 });
        let mut small = [1i8, -1];
        assert_eq!(small.word(1), u64::MAX);
        small.set_word(0, -3i64 as u64);
        assert_eq!(small, [-3, -1]);
    }

    #[test]
    fn what_a_field_means_is_its_documentation() {
        assert_eq!(Pair::MEANINGS, [" First.", " Second."]);
    }

    #[test]
    fn renaming_a_field_changes_the_hash() {
        let mut renamed = [Pair::LAYOUT[0], Pair::LAYOUT[1]];
        renamed[1].name = "second_kmh";
        assert_ne!(layout_hash("Pair", 16, &renamed), Pair::LAYOUT_HASH);
    }

    #[test]
    fn a_gap_between_fields_counts_as_padding() {
        let mut gap = [Pair::LAYOUT[0], Pair::LAYOUT[1]];
        gap[0].size = 4;
        assert!(!is_without_padding(16, &gap));
        assert!(is_without_padding(16, Pair::LAYOUT));
    }

    #[test]
    fn wire_name_ends_in_the_hash() {
        let expected = format!("dynocar.Pair.{:016x}", Pair::LAYOUT_HASH);
        assert_eq!(Pair::WIRE_NAME, expected);
    }
}
