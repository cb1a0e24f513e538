//! Messages of protobuf that are declared once, as a type and as a table of their fields.

/// A field of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageField {
    /// The name.
    pub name: &'static str,
    /// The protobuf number.
    pub number: u32,
    /// The name of the vocabulary, or else the type.
    pub type_name: &'static str,
    /// True where it may be missing.
    pub is_optional: bool,
    /// Meaning of the field.
    pub meaning: &'static str,
}

/// A message with the table of its fields from one list: number, name, type and protobuf's name of it, and the
/// vocabulary whose numbers it holds.
macro_rules! message {
    (
        #[doc = $what:literal]
        $name:ident {
            $(
                #[doc = $meaning:literal]
                $number:literal $field:ident: $type:ty = $kind:ident $($optional:ident)? $(($vocabulary:ident))?;
            )*
        }
    ) => {
        #[doc = $what]
        #[derive(Clone, PartialEq, prost::Message)]
        pub struct $name {
            $(
                #[doc = $meaning]
                #[prost($kind, $($optional,)? tag = $number)]
                pub $field: $type,
            )*
        }

        impl $name {
            /// Its name in the package.
            pub const NAME: &str = stringify!($name);
            /// Meaning of the message.
            pub const MEANING: &str = $what;
            /// Its fields, in order.
            pub const FIELDS: &[$crate::message::MessageField] = &[ $(
                $crate::message::MessageField {
                    name: stringify!($field),
                    number: $number,
                    type_name: $crate::message::type_name(stringify!($kind), stringify!($($vocabulary)?)),
                    is_optional: !stringify!($($optional)?).is_empty(),
                    meaning: $meaning,
                },
            )* ];
        }
    };
}

pub(crate) use message;

/// Returns the vocabulary, or else Rust's name of a protobuf type.
pub const fn type_name(kind: &str, vocabulary: &'static str) -> &'static str {
    match kind.as_bytes() {
        _ if !vocabulary.is_empty() => vocabulary,
        b"double" => "f64",
        b"int64" => "i64",
        b"uint64" => "u64",
        b"uint32" => "u32",
        _ => "string",
    }
}
