//! Codes, messages, and the barrier that panics do not pass.

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::reader::NoAnswer;
use dynocar_transport::{ChannelError, SendRefused};

/// Declares the codes with their numbers and texts, so that every code has a text.
macro_rules! codes {
    ($( $(#[doc = $doc:literal])* $code:ident = $number:literal $text:literal ),* $(,)?) => {
        /// Result codes of every function that can fail; `DYNOCAR_ERROR_…` in C.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(i32)]
        pub enum Code { $( $(#[doc = $doc])* $code = $number ),* }

        impl Code {
            /// Every code, in the order of its number.
            pub const ALL: &'static [Code] = &[ $( Code::$code ),* ];

            /// The code in words.
            pub const fn text(self) -> &'static CStr {
                match self { $( Code::$code => $text ),* }
            }

            /// Returns the meaning of the code, from its documentation.
            pub const fn meaning(self) -> &'static str {
                match self { $( Code::$code => concat!($($doc),*) ),* }
            }

            /// The code with this number.
            pub fn from_number(number: i32) -> Option<Self> {
                Self::ALL.iter().copied().find(|code| *code as i32 == number)
            }
        }
    };
}

codes! {
    /// Done.
    Ok = 0 c"done",
    /// A pointer that must not be NULL is NULL.
    NullArgument = 1 c"a pointer that must not be NULL is NULL",
    /// A number that means nothing or lies out of range, or that is not finite.
    BadNumber = 2 c"a number means nothing, lies out of range or is not finite",
    /// The handle belongs to the thread that opened it.
    WrongThread = 3 c"the handle was opened by another thread",
    /// The root directory's name cannot be used: not absolute, too long, or special characters.
    RootName = 4 c"the root directory's name cannot be used",
    /// A run-time directory or file cannot be used.
    Directory = 5 c"a run-time directory or file cannot be used",
    /// Another process drives the train.
    Occupied = 6 c"the train already has a controller",
    /// The daemon there speaks another schema, layout or transport version.
    IncompatibleDaemon = 7 c"the daemon is of an incompatible release",
    /// The shared memory cannot be used.
    Transport = 8 c"the shared memory cannot be used",
    /// The sample was not taken and counts as lost; just go on.
    SendRefused = 9 c"the transport took no message",
    /// No snapshot of this pipeline has come yet.
    NoSnapshot = 10 c"no snapshot of this pipeline has come yet",
    /// The snapshot's pipeline does not estimate this parameter.
    NotInSnapshot = 11 c"the pipeline does not estimate this parameter",
    /// A fault inside the library, in words on standard error: close the handle.
    Panic = 12 c"a fault inside the library",
    /// The train does not slow down, at the values given or at the edge of the bound.
    DoesNotStop = 13 c"the train does not slow down",
    /// The daemon's configuration lets no pipeline answer this quantity for the train.
    NotProvided = 14 c"no pipeline answers this quantity for the train",
    /// Every place of the train's channel is taken: close the ends that are no longer needed.
    NoPlaceLeft = 15 c"all places of the train's channel are taken",
    /// The handle was opened before `fork()`, in the parent: its ends are the parent's.
    ForkedProcess = 16 c"the handle was opened by the process that forked this one",
    /// The root directory was removed or replaced: close all ends and open them again.
    RootGone = 17 c"the root directory was removed or replaced",
    /// The daemon, or the controller, has a `/dev/shm` of its own: containers have to share one.
    SeparateMemory = 18 c"the other side has a /dev/shm of its own",
}

impl From<&ChannelError> for Code {
    fn from(error: &ChannelError) -> Self {
        match error {
            ChannelError::Directory { .. }
            | ChannelError::Locked { .. }
            | ChannelError::OpenFiles { .. }
            | ChannelError::RootShared { .. }
            | ChannelError::RootOfAnother { .. } => Code::Directory,
            ChannelError::RootGone { .. } => Code::RootGone,
            ChannelError::RootName { .. } | ChannelError::RootLength { .. } => Code::RootName,
            ChannelError::Occupied { .. } => Code::Occupied,
            ChannelError::SeparateMemory { .. } => Code::SeparateMemory,
            ChannelError::IncompatiblePeer { .. } => Code::IncompatibleDaemon,
            ChannelError::Transport { .. }
            | ChannelError::Stranger { .. }
            | ChannelError::SharedMemoryFull { .. }
            | ChannelError::SharedMemoryUnusable { .. } => Code::Transport,
            ChannelError::NoPlaceLeft { .. } => Code::NoPlaceLeft,
            ChannelError::Send(_) => Code::SendRefused,
        }
    }
}

impl From<NoAnswer> for Code {
    fn from(why: NoAnswer) -> Self {
        match why {
            NoAnswer::NoSnapshot => Code::NoSnapshot,
            NoAnswer::NotProvided => Code::NotProvided,
        }
    }
}

impl From<SendRefused> for Code {
    fn from(_: SendRefused) -> Self {
        Code::SendRefused
    }
}

/// Why a call that answers in words failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    /// Refused by the interface itself.
    #[error("{}", .0.text().to_string_lossy())]
    Interface(Code),
    /// Refused by the channel.
    #[error(transparent)]
    Channel(#[from] ChannelError),
}

/// The caller's buffer for a message.
#[derive(Clone, Copy)]
pub(super) struct Message {
    place: *mut c_char,
    size: usize,
}

impl Message {
    /// An empty message in the caller's buffer; a NULL or empty buffer takes no words.
    ///
    /// # Safety
    ///
    /// `place` is NULL or points to `size` writable bytes for as long as the message is used.
    pub(super) unsafe fn new(place: *mut c_char, size: usize) -> Self {
        let message = Message { place, size };
        message.write("");
        message
    }

    /// Writes the text, cut between two characters where the buffer ends.
    pub(super) fn write(self, text: &str) {
        if self.place.is_null() || self.size == 0 {
            return;
        }
        let length = text.floor_char_boundary(self.size - 1);
        // SAFETY: `new` was promised `size` writable bytes; `length` is at most `size` - 1, which
        // leaves room for the NUL, and a Rust string never overlaps the caller's buffer.
        unsafe {
            std::ptr::copy_nonoverlapping(text.as_ptr(), self.place.cast::<u8>(), length);
            self.place.add(length).write(0);
        }
    }
}

/// Runs the body of an exported function: a panic becomes a code.
///
/// # Real-time
///
/// Costs nothing while nothing panics.
pub(super) fn guard(work: impl FnOnce() -> Result<(), Code>) -> i32 {
    let code = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => Code::Ok,
        Ok(Err(code)) => code,
        Err(payload) => {
            // Dropping a foreign payload may panic once more; leaking it cannot.
            std::mem::forget(payload);
            Code::Panic
        }
    };
    code as i32
}

/// [`guard`] for functions that also answer in words. Allocates: not for the control cycle.
pub(super) fn guard_in_words(message: Message, work: impl FnOnce() -> Result<(), Failure>) -> i32 {
    let code = guard(|| {
        work().map_err(|failure| {
            message.write(&failure.to_string());
            match failure {
                Failure::Interface(code) => code,
                Failure::Channel(error) => Code::from(&error),
            }
        })
    });
    if code == Code::Panic as i32 {
        message.write("a fault inside the library; its words went to standard error");
    }
    code
}

/// The code in words; a number that is no code reads as such. Never NULL, never to be freed.
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_code_text(code: i32) -> *const c_char {
    Code::from_number(code).map_or(c"not a code of this release", Code::text).as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_code_and_words() {
        assert_eq!(guard(|| panic!("on purpose")), Code::Panic as i32);
        let mut buffer = [1 as c_char; 80];
        // SAFETY: the buffer outlives the message.
        let message = unsafe { Message::new(buffer.as_mut_ptr(), buffer.len()) };
        assert_eq!(guard_in_words(message, || panic!("on purpose")), Code::Panic as i32);
        // SAFETY: the message ends with a NUL inside the buffer.
        let words = unsafe { CStr::from_ptr(buffer.as_ptr()) }.to_str().unwrap();
        assert!(words.starts_with("a fault inside the library"), "{words}");
    }

    #[test]
    fn a_long_message_is_cut_between_characters_and_ends_with_nul() {
        let mut buffer = [1 as c_char; 8];
        // SAFETY: the message may use the first six bytes of the buffer.
        let message = unsafe { Message::new(buffer.as_mut_ptr(), 6) };
        message.write("abcdé");
        // SAFETY: the message ends with a NUL inside the buffer.
        let words = unsafe { CStr::from_ptr(buffer.as_ptr()) }.to_str().unwrap();
        assert_eq!(words, "abcd");
        assert_eq!(buffer[6..], [1, 1]);
    }

    #[test]
    fn a_null_or_empty_buffer_takes_no_words() {
        // SAFETY: NULL is allowed.
        unsafe { Message::new(std::ptr::null_mut(), 100) }.write("words");
        let mut byte: c_char = 1;
        // SAFETY: no byte may be written, and none is.
        unsafe { Message::new(&raw mut byte, 0) }.write("words");
        assert_eq!(byte, 1);
    }

    #[test]
    fn every_code_has_its_number_and_text() {
        for (number, &code) in Code::ALL.iter().enumerate() {
            assert_eq!(code as usize, number);
            assert_eq!(dynocar_code_text(number as i32), code.text().as_ptr());
        }
    }
}
