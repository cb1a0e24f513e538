//! The folder where the FMU was unpacked, the files that describe train and line, and the models for them.

use std::ffi::{CStr, CString, OsString};
use std::io::ErrorKind;
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dynocar_analysis::dataset::{parse_track, parse_train};
use dynocar_analysis::driven::{Beginning, DrivenTrain};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, TrainId};

use super::error::ModelError;
use super::estimators::{Estimators, PIPELINES};
use super::variables::ModelFile;

/// The train of an instance; there is no other in it.
pub const TRAIN: TrainId = TrainId(1);

impl ModelFile {
    /// Returns the file's name inside the FMU, in the folder `resources`.
    pub const fn own_name(self) -> &'static str {
        match self {
            ModelFile::Train => "train.toml",
            ModelFile::Track => "track.toml",
        }
    }
}

/// Which files describe train and line.
#[derive(Clone, Debug)]
pub struct DescriptionFiles {
    resources: String,
    /// As they were set; empty for the FMU's own.
    train: CString,
    track: CString,
}

impl DescriptionFiles {
    /// Returns the FMU's own files at a location, as the simulator names it.
    pub fn from_resources(resources: String) -> Self {
        DescriptionFiles { resources, train: CString::default(), track: CString::default() }
    }

    /// Returns where the FMU's own files are.
    pub fn resources(&self) -> String {
        self.resources.clone()
    }

    /// Returns the path that was set.
    pub fn path(&self, file: ModelFile) -> &CStr {
        match file {
            ModelFile::Train => &self.train,
            ModelFile::Track => &self.track,
        }
    }

    /// Names another file.
    pub fn set(&mut self, file: ModelFile, path: &CStr) {
        match file {
            ModelFile::Train => self.train = path.into(),
            ModelFile::Track => self.track = path.into(),
        }
    }

    /// Returns the recommended estimators for this train on this line.
    ///
    /// # Errors
    ///
    /// Problem of the files.
    pub fn estimators(&self) -> Result<Estimators, ModelError> {
        let (train, track) = self.read()?;
        let pipeline = |(index, &kind): (usize, &PipelineKind)| {
            let settings = EstimatorSettings::default_of(kind).expect("every kind can be built");
            let estimator = settings.build(&train)?;
            Ok(Pipeline::new(TRAIN, index as u32, Arc::clone(&train), track.clone(), estimator))
        };
        let pipelines: Result<_, ModelError> = PIPELINES.iter().enumerate().map(pipeline).collect();
        Ok(Estimators::new(pipelines?))
    }

    /// Returns this train on this line, to be driven.
    ///
    /// # Errors
    ///
    /// Problem of the files.
    pub fn driven(&self, beginning: Beginning) -> Result<DrivenTrain, ModelError> {
        let (train, track) = self.read()?;
        Ok(DrivenTrain::new(train, track, beginning))
    }

    fn read(&self) -> Result<(Arc<TrainModel>, Option<Arc<Track>>), ModelError> {
        Ok((Arc::new(self.read_train()?), self.read_track()?.map(Arc::new)))
    }

    fn read_train(&self) -> Result<TrainModel, ModelError> {
        let path = self.place(ModelFile::Train)?;
        let text = text_of(&path).map_err(|error| match error {
            ModelError::Unreadable { path, source }
                if self.train.is_empty() && source.kind() == ErrorKind::NotFound =>
            {
                ModelError::NoTrain(path)
            }
            error => error,
        })?;
        Ok(parse_train(&path.display().to_string(), &text)?)
    }

    /// `None` where no line was named and the FMU brings none along.
    fn read_track(&self) -> Result<Option<Track>, ModelError> {
        let path = match self.place(ModelFile::Track) {
            Err(ModelError::NoFolder(_)) if self.track.is_empty() => return Ok(None),
            place => place?,
        };
        if self.track.is_empty() && !path.exists() {
            return Ok(None);
        }
        let text = text_of(&path)?;
        Ok(Some(parse_track(&path.display().to_string(), &text)?))
    }

    /// Returns where a file lies; a relative path counts from the FMU's own files.
    fn place(&self, file: ModelFile) -> Result<PathBuf, ModelError> {
        let set = self.path(file).to_string_lossy();
        let path = Path::new(if set.is_empty() { file.own_name() } else { &*set });
        if path.is_absolute() {
            return Ok(path.into());
        }
        let folder = folder_of(&self.resources)
            .ok_or_else(|| ModelError::NoFolder(self.resources.clone()))?;
        Ok(folder.join(path))
    }
}

fn text_of(path: &Path) -> Result<String, ModelError> {
    let unreadable = |source| ModelError::Unreadable { path: path.into(), source };
    std::fs::read_to_string(path).map_err(unreadable)
}

/// Returns the folder that a `file:` URI means (RFC 8089), or a plain absolute path; `None` for any other.
pub fn folder_of(location: &str) -> Option<PathBuf> {
    let Some(rest) = location.strip_prefix("file:") else {
        return location.starts_with('/').then(|| location.into());
    };
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
        None => rest,
    };
    let bytes = percent_decoded(path.as_bytes())?;
    bytes.starts_with(b"/").then(|| OsString::from_vec(bytes).into())
}

/// `None` where a percent sign is followed by no two hexadecimal digits.
fn percent_decoded(text: &[u8]) -> Option<Vec<u8>> {
    let mut decoded = Vec::with_capacity(text.len());
    let mut rest = text.iter();
    while let Some(&byte) = rest.next() {
        let mut digit = || char::from(*rest.next()?).to_digit(16);
        decoded.push(if byte == b'%' { (16 * digit()? + digit()?) as u8 } else { byte });
    }
    Some(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_found_by_any_way_of_writing_its_uri() {
        let expected = Some(PathBuf::from("/tmp/a b/é#1"));
        for location in [
            "file:///tmp/a%20b/%C3%A9%231",
            "file://localhost/tmp/a%20b/%c3%a9%231",
            "file:/tmp/a%20b/é%231",
            "/tmp/a b/é#1",
        ] {
            assert_eq!(folder_of(location), expected, "{location}");
        }
    }

    #[test]
    fn what_is_no_local_folder_is_none() {
        for location in
            ["", "resources", "https://host/a", "file://host/a", "file:///a%2", "file:///%zz"]
        {
            assert_eq!(folder_of(location), None, "{location}");
        }
    }
}
