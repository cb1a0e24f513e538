//! Inputs during a step, with their slopes where they are given; the folder where the FMU was unpacked, the files that
//! describe train and line, and the models for them.

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
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};

use super::error::ModelError;
use super::estimators::{Estimators, PIPELINES};
use super::variables::{MISSING, ModelFile};

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
    /// As they were set, by [`ModelFile`]; empty for the FMU's own.
    paths: [CString; 2],
}

impl DescriptionFiles {
    /// Returns the FMU's own files at a location, as the simulator names it.
    pub fn from_resources(resources: String) -> Self {
        DescriptionFiles { resources, paths: Default::default() }
    }

    /// Returns where the FMU's own files are.
    pub fn resources(&self) -> String {
        self.resources.clone()
    }

    /// Returns the path that was set.
    pub fn path(&self, file: ModelFile) -> &CStr {
        &self.paths[file as usize]
    }

    /// Names another file.
    pub fn set(&mut self, file: ModelFile, path: &CStr) {
        self.paths[file as usize] = path.into();
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
                if self.path(ModelFile::Train).is_empty()
                    && source.kind() == ErrorKind::NotFound =>
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
            Err(ModelError::NoFolder(_)) if self.path(ModelFile::Track).is_empty() => {
                return Ok(None);
            }
            place => place?,
        };
        if self.path(ModelFile::Track).is_empty() && !path.exists() {
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

/// The inputs of an instance.
#[derive(Clone, Copy, Debug)]
pub struct Inputs {
    /// The inputs as they were set; the sample's number is that of the newest step.
    pub sample: TrainSample,
    /// Slopes by [`SampleField`], in the input's unit per s.
    slopes: [f64; SampleField::ALL.len()],
}

impl Default for Inputs {
    fn default() -> Self {
        let sample = TrainSample { run: 1, ..TrainSample::empty(TRAIN) };
        Inputs { sample, slopes: [0.0; SampleField::ALL.len()] }
    }
}

impl Inputs {
    /// Sets a measured input; [`MISSING`] and NaN mean that it was not measured.
    pub fn set(&mut self, field: SampleField, value: f64) {
        if value.is_nan() || value == MISSING {
            self.sample.valid &= !field.bit();
        } else {
            self.sample.set(field, value);
        }
    }

    /// Returns the value of a field.
    pub fn get(&self, field: SampleField) -> f64 {
        self.sample.get(field).unwrap_or(MISSING)
    }

    /// Sets a slope for one step; a simulator that interpolates towards a missing value gives a slope that is no
    /// number.
    pub fn set_slope(&mut self, field: SampleField, per_s: f64) {
        self.slopes[field as usize] = if per_s.is_finite() { per_s } else { 0.0 };
    }

    /// Forgets the slopes: each holds for one step.
    pub fn end_step(&mut self) {
        self.slopes.fill(0.0);
    }

    /// Returns the sample that acts `after_s` seconds after a time in s.
    #[inline]
    pub fn at(&self, time_s: f64, after_s: f64) -> TrainSample {
        let mut sample = self.sample;
        sample.time_ns = nanoseconds(time_s + after_s);
        for field in SampleField::ALL {
            if let Some(value) = sample.get(field) {
                sample.set(field, value + self.slopes[field as usize] * after_s);
            }
        }
        sample
    }
}

/// As the reader of recorded runs makes a time of a cell.
pub fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
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

    #[test]
    fn a_slope_holds_for_one_step_and_what_is_missing_stays_missing() {
        let mut inputs = Inputs::default();
        inputs.set(SampleField::TractionForce, 1e3);
        inputs.set_slope(SampleField::TractionForce, 200.0);
        inputs.set_slope(SampleField::BrakeForce, 5.0);
        let later = inputs.at(3.0, 0.5);
        assert_eq!((later.time_ns, later.traction_force_n), (3_500_000_000, 1100.0));
        assert_eq!(later.get(SampleField::BrakeForce), None);
        inputs.set_slope(SampleField::TractionForce, f64::NAN);
        assert_eq!(inputs.at(3.0, 0.5).traction_force_n, 1e3, "no number is no slope");
        inputs.set_slope(SampleField::TractionForce, 200.0);
        inputs.end_step();
        assert_eq!(inputs.at(3.0, 0.5).traction_force_n, 1e3);
        inputs.set(SampleField::TractionForce, f64::NAN);
        assert_eq!(inputs.get(SampleField::TractionForce), MISSING);
    }
}
