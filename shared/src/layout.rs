//! How a shared-memory type describes its own bytes.
//!
//! [`wire_struct!`](crate::wire_struct) declares a `#[repr(C)]` struct, refuses padding at compile time, and gives
//! the struct a `LAYOUT` (name, type, offset and size of each field) and a `LAYOUT_HASH` over
//! it. Two peers whose hashes differ never exchange a byte: the hash is part of the type name
//! that the channel compares before it maps anything.

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

/// True when the fields, in order, fill `size` bytes without a gap.
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

/// The sixteen lower-case hexadecimal digits of a hash, for use inside a constant name.
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

/// Declares a shared-memory struct: `#[repr(C)]`, no padding, with `LAYOUT`, `LAYOUT_HASH` and
/// the `WIRE_NAME` that a channel compares (`dynocar.<Struct>.<hash>`).
#[macro_export]
macro_rules! wire_struct {
    ($(#[$meta:meta])* pub struct $name:ident {
        $( $(#[$field_meta:meta])* pub $field:ident : $ty:ty ),* $(,)?
    }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $( $(#[$field_meta])* pub $field: $ty ),* }

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
