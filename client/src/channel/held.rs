//! What the transport gives, behind trait objects.
//!
//! The transport's generic code, some thousand functions, is so compiled in this crate once, and not in every crate
//! that opens or drops a port.

use std::fmt::Debug;

/// Something of the transport's that is dropped by code of this crate.
#[derive(Debug)]
pub(super) struct Held<P>(Box<dyn Hold<P>>);

trait Hold<P>: Debug {
    fn held(&self) -> &P;
}

#[derive(Debug)]
struct Holder<P>(P);

impl<P: Debug> Hold<P> for Holder<P> {
    fn held(&self) -> &P {
        &self.0
    }
}

impl<P: Debug + 'static> Held<P> {
    pub(super) fn new(held: P) -> Self {
        Held(Box::new(Holder(held)))
    }

    pub(super) fn get(&self) -> &P {
        self.0.held()
    }
}
