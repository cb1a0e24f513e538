//! What stands behind an instance of the FMU: the sample that the inputs make, the estimators, and
//! the order in which the standard lets calls come.

use std::ffi::CStr;

use dynocar_core::pipeline::Pipeline;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{ParameterSnapshot, PipelineKind, SampleField, TrainSample};

use crate::error::ModelError;
use crate::files::{Files, TRAIN};
use crate::variables::{Kind, MISSING, Meaning, PIPELINES, Told, VARIABLES, Variable};

/// Later times in s have no number of ns.
const TIME_MAX_S: f64 = 9e9;
/// What is told before the files are read.
static NOTHING: ParameterSnapshot = ParameterSnapshot::empty();

/// Where an instance stands between two calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Instantiated,
    Initializing,
    Stepping,
    Terminated,
    Broken,
}

impl Phase {
    const fn words(self) -> &'static str {
        match self {
            Phase::Instantiated => "before initialization",
            Phase::Initializing => "during initialization",
            Phase::Stepping => "between steps",
            Phase::Terminated => "after the end",
            Phase::Broken => "after a fault inside the FMU",
        }
    }
}

/// An instance of the FMU.
pub struct Model {
    phase: Phase,
    files: Files,
    /// What the inputs make; its number is that of the newest step.
    sample: TrainSample,
    /// Speed in m/s of the newest step's sample; NaN before it.
    speed_mps: f64,
    /// By [`PIPELINES`]; none before the files are read.
    pipelines: Vec<Pipeline>,
}

impl Model {
    /// An instance with the start value of every variable; `resources` is the location of the FMU's
    /// own files, as the simulator names it.
    pub fn new(resources: String) -> Self {
        let sample = TrainSample { run: 1, ..TrainSample::empty(TRAIN) };
        Model {
            phase: Phase::Instantiated,
            files: Files::of(resources),
            sample,
            speed_mps: f64::NAN,
            pipelines: Vec::new(),
        }
    }

    fn require(&self, allowed: &[Phase], call: &'static str) -> Result<(), ModelError> {
        if allowed.contains(&self.phase) {
            Ok(())
        } else {
            Err(ModelError::WrongOrder { call, now: self.phase.words() })
        }
    }

    /// Takes note of an experiment; which one, no estimator asks.
    ///
    /// # Errors
    ///
    /// In the wrong order.
    pub fn set_up_experiment(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Instantiated], "fmi2SetupExperiment")
    }

    /// Reads the files and builds the estimators.
    ///
    /// # Errors
    ///
    /// In the wrong order, or what is wrong with the files.
    pub fn enter_initialization(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Instantiated], "fmi2EnterInitializationMode")?;
        self.pipelines = self.files.estimators()?;
        self.phase = Phase::Initializing;
        Ok(())
    }

    /// Ends the initialization; files that were set in it are read.
    ///
    /// # Errors
    ///
    /// In the wrong order, or what is wrong with the files.
    pub fn exit_initialization(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Initializing], "fmi2ExitInitializationMode")?;
        if self.pipelines.is_empty() {
            self.pipelines = self.files.estimators()?;
        }
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// Takes the inputs as the sample of the moment at which the step begins.
    ///
    /// # Errors
    ///
    /// In the wrong order, or for times that are no numbers.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock, unless it fails.
    pub fn step(&mut self, time_s: f64, step_s: f64) -> Result<(), ModelError> {
        self.require(&[Phase::Stepping], "fmi2DoStep")?;
        if !(time_s.abs() <= TIME_MAX_S) {
            let (name, expected) = ("currentCommunicationPoint", "a time in s from -9e9 to 9e9");
            return Err(ModelError::BadValue { name, value: time_s, expected });
        }
        if !(0.0..=TIME_MAX_S).contains(&step_s) {
            let (name, expected) = ("communicationStepSize", "a duration in s from 0 to 9e9");
            return Err(ModelError::BadValue { name, value: step_s, expected });
        }
        // As the reader of recorded runs makes a time of a cell.
        self.sample.time_ns = (time_s * 1e9).round() as i64;
        self.sample.sequence += 1;
        self.speed_mps = self.sample.get(SampleField::Speed).unwrap_or(f64::NAN);
        for pipeline in &mut self.pipelines {
            pipeline.process(&self.sample);
        }
        Ok(())
    }

    /// Ends the simulation; results can still be got.
    ///
    /// # Errors
    ///
    /// In the wrong order.
    pub fn terminate(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Stepping], "fmi2Terminate")?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    /// Forgets everything since the instance was made.
    pub fn reset(&mut self) {
        *self = Model::new(self.files.resources());
    }

    /// Refuses every later call but a reset: nobody knows what a fault left behind.
    pub fn break_off(&mut self) {
        self.phase = Phase::Broken;
    }

    /// A variable's number.
    ///
    /// # Errors
    ///
    /// When there is none of this type, or after a fault.
    pub fn real(&self, reference: u32) -> Result<f64, ModelError> {
        let variable = self.got(reference, Kind::Real)?;
        Ok(match variable.meaning {
            Meaning::Measured(field) => self.sample.get(field).unwrap_or(MISSING),
            Meaning::Estimate(of, told) => self.told_real(of, told).unwrap_or(f64::NAN),
            _ => f64::NAN,
        })
    }

    /// A variable's whole number, or the number of a member of a vocabulary.
    ///
    /// # Errors
    ///
    /// When there is none of this type, or after a fault.
    pub fn integer(&self, reference: u32) -> Result<i32, ModelError> {
        let variable = self.got(reference, Kind::Integer)?;
        let number: u64 = match variable.meaning {
            Meaning::Direction => return Ok(self.sample.direction.into()),
            Meaning::Run => self.sample.run.into(),
            Meaning::Estimate(of, told) => {
                let snapshot = self.snapshot(of);
                match told {
                    Told::Status => snapshot.status.into(),
                    Told::Reason => snapshot.reason.into(),
                    Told::SuspectedEffect => snapshot.suspected_effect.into(),
                    _ => snapshot.samples_rejected,
                }
            }
            _ => 0,
        };
        Ok(i32::try_from(number).unwrap_or(i32::MAX))
    }

    /// A variable's truth value.
    ///
    /// # Errors
    ///
    /// When there is none of this type, or after a fault.
    pub fn boolean(&self, reference: u32) -> Result<bool, ModelError> {
        self.got(reference, Kind::Boolean)?;
        Ok(self.sample.flags & FLAG_WHEEL_SLIDE != 0)
    }

    /// A variable's text, valid until it is set.
    ///
    /// # Errors
    ///
    /// When there is none of this type, or after a fault.
    pub fn string(&self, reference: u32) -> Result<&CStr, ModelError> {
        let variable = self.got(reference, Kind::String)?;
        let Meaning::File(file) = variable.meaning else { return Ok(c"") };
        Ok(self.files.path(file))
    }

    /// Sets a measured input; [`MISSING`] and NaN say that it was not measured.
    ///
    /// # Errors
    ///
    /// When it is no input of this type, or in the wrong order.
    pub fn set_real(&mut self, reference: u32, value: f64) -> Result<(), ModelError> {
        if let Meaning::Measured(field) = self.to_be_set(reference, Kind::Real)?.meaning {
            if value.is_nan() || value == MISSING {
                self.sample.valid &= !field.bit();
            } else {
                self.sample.set(field, value);
            }
        }
        Ok(())
    }

    /// Sets the number of the run or the direction.
    ///
    /// # Errors
    ///
    /// When it is no input of this type, a negative run, or in the wrong order.
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<(), ModelError> {
        let Variable { name, meaning, .. } = *self.to_be_set(reference, Kind::Integer)?;
        let bad = |expected| ModelError::BadValue { name, value: value.into(), expected };
        match meaning {
            Meaning::Run => {
                self.sample.run = u32::try_from(value).map_err(|_| bad("0 or more"))?;
            }
            Meaning::Direction => {
                self.sample.direction = i8::try_from(value).map_err(|_| bad("1 or -1"))?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Sets whether wheel-slide protection is active.
    ///
    /// # Errors
    ///
    /// When it is no input of this type, or in the wrong order.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), ModelError> {
        self.to_be_set(reference, Kind::Boolean)?;
        self.sample.flags = if value { FLAG_WHEEL_SLIDE } else { 0 };
        Ok(())
    }

    /// Sets the path of a file; a relative one counts from the FMU's own files.
    ///
    /// # Errors
    ///
    /// When it is no parameter of this type, or after the initialization.
    pub fn set_string(&mut self, reference: u32, value: &CStr) -> Result<(), ModelError> {
        let Variable { name, meaning, .. } = *self.to_be_set(reference, Kind::String)?;
        self.require(&[Phase::Instantiated, Phase::Initializing], "to set a file")?;
        if value.to_str().is_err() {
            return Err(ModelError::NotText(name));
        }
        if let Meaning::File(file) = meaning {
            self.files.set(file, value);
            self.pipelines.clear();
        }
        Ok(())
    }

    fn got(&self, reference: u32, expected: Kind) -> Result<&'static Variable, ModelError> {
        let phases = [Phase::Instantiated, Phase::Initializing, Phase::Stepping, Phase::Terminated];
        self.require(&phases, "to get a variable")?;
        variable(reference, expected)
    }

    fn to_be_set(&self, reference: u32, expected: Kind) -> Result<&'static Variable, ModelError> {
        let phases = [Phase::Instantiated, Phase::Initializing, Phase::Stepping];
        self.require(&phases, "to set a variable")?;
        let variable = variable(reference, expected)?;
        match variable.meaning {
            Meaning::Estimate(..) => Err(ModelError::NotAnInput(variable.name)),
            _ => Ok(variable),
        }
    }

    fn snapshot(&self, of: PipelineKind) -> &ParameterSnapshot {
        let place = PIPELINES.iter().position(|&kind| kind == of);
        place.and_then(|place| self.pipelines.get(place)).map_or(&NOTHING, Pipeline::snapshot)
    }

    fn told_real(&self, of: PipelineKind, told: Told) -> Option<f64> {
        let snapshot = self.snapshot(of);
        match told {
            Told::Value(parameter) => snapshot.value(parameter),
            Told::Std(parameter) => snapshot.std(parameter),
            Told::Resistance => Some(snapshot.resistance_at(self.speed_mps)?.w0_n_per_kn),
            Told::ResistanceStd => Some(snapshot.resistance_at(self.speed_mps)?.w0_std_n_per_kn),
            Told::UnexplainedForce => Some(snapshot.unexplained_force_n),
            Told::UnexplainedForceStd => Some(snapshot.unexplained_force_std_n),
            Told::SuspectedEffect | Told::Status | Told::Reason | Told::Rejected => None,
        }
    }
}

/// The variable of a reference and a type; enumerations are got and set as whole numbers.
fn variable(reference: u32, expected: Kind) -> Result<&'static Variable, ModelError> {
    let variable =
        VARIABLES.get(reference as usize).ok_or(ModelError::UnknownReference(reference))?;
    let is = match variable.meaning.kind() {
        Kind::Enumeration(_) => Kind::Integer,
        kind => kind,
    };
    if is == expected {
        return Ok(variable);
    }
    let (name, expected) = (variable.name, expected.name());
    Err(ModelError::WrongType { name, is: is.name(), expected })
}
