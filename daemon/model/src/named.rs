//! Enums whose members have names in files, on command lines and in answers.

/// Declares such an enum: each member with its documentation and its name; `("in a file")` says where the names are
/// used.
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $name:ident ($what:literal) {
        $( $(#[doc = $doc:literal])* $item:ident $(= $number:literal)? $text:literal; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $( $(#[doc = $doc])* $item $(= $number)? ),* }

        impl $name {
            /// Every member.
            pub const ALL: [$name; [$( $name::$item ),*].len()] = [$( $name::$item ),*];

            #[doc = concat!("The name ", $what, ".")]
            pub const fn name(self) -> &'static str {
                match self { $( $name::$item => $text ),* }
            }

            /// Returns the member of this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|member| member.name() == name)
            }
        }
    };
}

#[cfg(test)]
mod tests {
    named! {
        /// Position of a door.
        Door ("in a test") {
            /// Nobody gets in.
            Shut = 3 "shut";
            /// Somebody may.
            Ajar "a_jar";
        }
    }

    #[test]
    fn a_name_leads_back_to_its_member() {
        assert_eq!(Door::ALL, [Door::Shut, Door::Ajar]);
        assert_eq!((Door::Shut as u8, Door::Ajar as u8), (3, 4));
        assert_eq!(Door::from_name("a_jar"), Some(Door::Ajar));
        assert_eq!((Door::from_name("open"), Door::Shut.name()), (None, "shut"));
    }
}
