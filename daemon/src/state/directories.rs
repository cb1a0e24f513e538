//! The directories of states, and the daemon's right to keep states there.

use std::ffi::OsString;
use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access};

/// Why no state is kept.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    /// Nothing says where states of this user lie.
    #[error(
        "neither STATE_DIRECTORY, XDG_STATE_HOME nor HOME is an absolute path: name a directory, [state] directory"
    )]
    Nowhere,
    /// The directory cannot be made or used.
    #[error("{}: {source}", path.display())]
    Unusable {
        /// The directory.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// Others may write into the usual directory.
    #[error("{}: users other than its owner may write into it: chmod 700 it", path.display())]
    Open {
        /// The directory.
        path: PathBuf,
    },
}

/// Returns the directory to keep states in, made where it is not there: the one that the configuration names,
/// else the usual one, which is closed to other users.
///
/// # Errors
///
/// If there is no folder, or it cannot be used.
pub fn prepare(named: Option<&Path>) -> Result<PathBuf, PlaceError> {
    if let Some(path) = named {
        return usable(path.to_owned());
    }
    let path = usual(|name| std::env::var_os(name)).ok_or(PlaceError::Nowhere)?;
    let made = DirBuilder::new().recursive(true).mode(0o700).create(&path);
    let rights = made.and_then(|()| std::fs::metadata(&path));
    match rights {
        Err(source) => Err(PlaceError::Unusable { path, source }),
        Ok(rights) if rights.mode() & 0o022 != 0 => Err(PlaceError::Open { path }),
        Ok(_) => usable(path),
    }
}

fn usable(path: PathBuf) -> Result<PathBuf, PlaceError> {
    match access(&path, Access::WRITE_OK | Access::EXEC_OK) {
        Ok(()) => Ok(path),
        Err(error) => Err(PlaceError::Unusable { path, source: error.into() }),
    }
}

/// systemd's directory of the service, else the user's for states.
fn usual(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let absolute = |path: PathBuf| path.is_absolute().then_some(path);
    let service = variable("STATE_DIRECTORY").and_then(|all| {
        // Several are separated by colons.
        absolute(all.to_string_lossy().split(':').next()?.into())
    });
    let user = || absolute(variable("XDG_STATE_HOME")?.into()).map(|it| it.join("dynocar"));
    let home = || absolute(variable("HOME")?.into()).map(|it| it.join(".local/state/dynocar"));
    service.or_else(user).or_else(home)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_service_has_its_own_directory_and_a_user_that_of_the_desktop_standard() {
        let usual = |variables: &[(&str, &str)]| {
            let found = |name: &str| variables.iter().find(|it| it.0 == name).map(|it| it.1.into());
            usual(found).map(|path| path.display().to_string())
        };
        let home = ("HOME", "/home/me");
        let service = ("STATE_DIRECTORY", "/var/lib/dynocar:/var/lib/other");
        let user = ("XDG_STATE_HOME", "/states");
        assert_eq!(usual(&[home, user, service]).as_deref(), Some("/var/lib/dynocar"));
        assert_eq!(usual(&[home, user]).as_deref(), Some("/states/dynocar"));
        assert_eq!(usual(&[home]).as_deref(), Some("/home/me/.local/state/dynocar"));
        let wrong = ("XDG_STATE_HOME", "states");
        assert_eq!(usual(&[home, wrong]).as_deref(), Some("/home/me/.local/state/dynocar"));
        assert_eq!(usual(&[wrong, ("STATE_DIRECTORY", "")]), None);
    }

    #[test]
    fn a_directory_that_is_named_is_not_made() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(prepare(Some(folder.path())).unwrap(), folder.path());
        let error = prepare(Some(&folder.path().join("none"))).unwrap_err();
        assert!(error.to_string().contains("No such file"), "{error}");
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        std::fs::set_permissions(&file, PermissionsExt::from_mode(0o600)).unwrap();
        assert!(matches!(prepare(Some(&file)), Err(PlaceError::Unusable { .. })));
    }
}
