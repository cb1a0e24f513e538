//! The model behind an instance of an FMU: its inputs, the estimators or the train that takes them, and the order of
//! calls that the standard prescribes.

use std::ffi::CStr;

use dynocar_analysis::driven::{Beginning, DrivenTrain};
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;

use crate::error::ModelError;
use crate::estimators::{ESTIMATORS, Estimators};
use crate::files::{DescriptionFiles, Inputs, nanoseconds};
use crate::plant::{
    BEGINNING, STEP_MAX_S, least_step_s, reported, require_drivable, with_beginning,
};
use crate::variables::{Begins, Interface, Kind, Meaning, SnapshotField, Variable};

/// Share of the time by which a communication point may be off, since sums of steps are rounded.
const POINT_TOLERANCE: f64 = 1e-9;
/// Time in s beyond which a number of ns cannot hold the time.
const TIME_MAX_S: f64 = 9e9;

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

/// The model behind an instance.
enum Behind {
    /// The files are not read yet.
    Nothing,
    Estimators(Estimators),
    Plant(Box<DrivenTrain>),
}

/// An instance of an FMU.
pub struct Model {
    interface: &'static Interface,
    phase: Phase,
    files: DescriptionFiles,
    inputs: Inputs,
    /// How the driven train begins, and when in s.
    beginning: Beginning,
    start_s: f64,
    /// Where the next step begins in s; before the first one of an experiment that was not set up, anywhere.
    next_s: Option<f64>,
    run_before: u32,
    behind: Behind,
}

impl Model {
    /// Returns an instance with the start value of every variable; `resources` is the location of the FMU's
    /// own files, as the simulator names it.
    pub fn new(interface: &'static Interface, resources: String) -> Self {
        Model {
            interface,
            phase: Phase::Instantiated,
            files: DescriptionFiles::from_resources(resources),
            inputs: Inputs::default(),
            beginning: BEGINNING,
            start_s: 0.0,
            next_s: None,
            run_before: 0,
            behind: Behind::Nothing,
        }
    }

    fn require(&self, allowed: &[Phase], call: &'static str) -> Result<(), ModelError> {
        if allowed.contains(&self.phase) {
            Ok(())
        } else {
            Err(ModelError::WrongOrder { call, now: self.phase.words() })
        }
    }

    /// Takes note of when an experiment begins, in s.
    ///
    /// # Errors
    ///
    /// In the wrong order, or for a time that is no number.
    pub fn set_up_experiment(&mut self, start_s: f64) -> Result<(), ModelError> {
        self.require(&[Phase::Instantiated], "fmi2SetupExperiment")?;
        self.start_s = require_time("startTime", start_s)?;
        self.next_s = Some(self.start_s);
        Ok(())
    }

    /// Reads the files and builds the model.
    ///
    /// # Errors
    ///
    /// When the call is out of order, or the files are wrong.
    pub fn enter_initialization(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Instantiated], "fmi2EnterInitializationMode")?;
        self.build()?;
        self.phase = Phase::Initializing;
        Ok(())
    }

    /// Ends the initialization; files and beginnings that were set in it are taken.
    ///
    /// # Errors
    ///
    /// When the call is out of order, or the files are wrong.
    pub fn exit_initialization(&mut self) -> Result<(), ModelError> {
        self.require(&[Phase::Initializing], "fmi2ExitInitializationMode")?;
        if matches!(self.behind, Behind::Nothing) {
            self.build()?;
        }
        if let Behind::Plant(train) = &mut self.behind {
            require_drivable(&self.inputs)?;
            train.look(&self.inputs.at(self.start_s, 0.0));
        }
        self.phase = Phase::Stepping;
        Ok(())
    }

    fn build(&mut self) -> Result<(), ModelError> {
        self.behind = if self.interface.guid == ESTIMATORS.guid {
            Behind::Estimators(self.files.estimators()?)
        } else {
            Behind::Plant(Box::new(self.files.driven(self.beginning)?))
        };
        Ok(())
    }

    /// Takes the inputs as they are at the beginning of the step.
    ///
    /// # Errors
    ///
    /// In the wrong order, for a point other than the end of the step before, and for a step that the train cannot take.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock, unless it fails.
    pub fn step(&mut self, time_s: f64, step_s: f64) -> Result<(), ModelError> {
        self.require(&[Phase::Stepping], "fmi2DoStep")?;
        require_time("currentCommunicationPoint", time_s)?;
        let name = "communicationStepSize";
        if !(0.0..=TIME_MAX_S).contains(&step_s) {
            let expected = "a duration in s from 0 to 9e9";
            return Err(ModelError::BadValue { name, value: step_s, expected });
        }
        // A new trip may have a clock of its own.
        if let Some(next_s) = self.next_s.filter(|_| self.inputs.sample.run == self.run_before)
            && (time_s - next_s).abs() > POINT_TOLERANCE * time_s.abs().max(step_s).max(1.0)
        {
            return Err(ModelError::OffPoint { time_s, next_s });
        }
        match &mut self.behind {
            Behind::Nothing => {}
            Behind::Estimators(estimators) => {
                self.inputs.sample.time_ns = nanoseconds(time_s);
                self.inputs.sample.sequence += 1;
                estimators.take(&self.inputs.sample);
            }
            Behind::Plant(train) => {
                let least_s = least_step_s(train);
                if step_s > STEP_MAX_S || (step_s > 0.0 && step_s < least_s) {
                    return Err(ModelError::BadStep { step_s, least_s, most_s: STEP_MAX_S });
                }
                require_drivable(&self.inputs)?;
                train.drive(step_s, |after_s| self.inputs.at(time_s, after_s));
                self.inputs.end_step();
            }
        }
        self.next_s = Some(time_s + step_s);
        self.run_before = self.inputs.sample.run;
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
        *self = Model::new(self.interface, self.files.resources());
    }

    /// Refuses every later call but a reset: after a fault the state is unknown.
    pub fn break_off(&mut self) {
        self.phase = Phase::Broken;
    }

    /// Returns a variable's number.
    ///
    /// # Errors
    ///
    /// If there is no such variable of this type, or after a fault.
    pub fn real(&self, reference: u32) -> Result<f64, ModelError> {
        let variable = self.got(reference, Kind::Real)?;
        Ok(match variable.meaning {
            Meaning::Measured(field) => self.inputs.get(field),
            Meaning::Begins(Begins::Speed) => self.beginning.speed_mps,
            Meaning::Begins(Begins::Position) => self.beginning.position_m,
            meaning => match (meaning, &self.behind) {
                (Meaning::Estimate(of, reported), Behind::Estimators(it)) => it.real(of, reported),
                (Meaning::Driven(what), Behind::Plant(train)) => Some(reported(train, what)),
                _ => None,
            }
            .unwrap_or(f64::NAN),
        })
    }

    /// Returns a variable's whole number, or the number of a member of a vocabulary.
    ///
    /// # Errors
    ///
    /// If there is no such variable of this type, or after a fault.
    pub fn integer(&self, reference: u32) -> Result<i32, ModelError> {
        let variable = self.got(reference, Kind::Integer)?;
        let number: u64 = match (variable.meaning, &self.behind) {
            (Meaning::Direction, _) => return Ok(self.inputs.sample.direction.into()),
            (Meaning::Run, _) => self.inputs.sample.run.into(),
            (Meaning::Estimate(of, reported), Behind::Estimators(it)) => it.integer(of, reported),
            _ => 0,
        };
        Ok(i32::try_from(number).unwrap_or(i32::MAX))
    }

    /// Returns a variable's truth value.
    ///
    /// # Errors
    ///
    /// If there is no such variable of this type, or after a fault.
    pub fn boolean(&self, reference: u32) -> Result<bool, ModelError> {
        Ok(match (self.got(reference, Kind::Boolean)?.meaning, &self.behind) {
            (Meaning::Begins(_), _) => self.beginning.is_held_at_rest,
            (Meaning::Estimate(of, SnapshotField::Usable(quantity)), Behind::Estimators(it)) => {
                it.is_usable(of, quantity)
            }
            _ => self.inputs.sample.flags & FLAG_WHEEL_SLIDE != 0,
        })
    }

    /// Returns a variable's text, valid until it is set.
    ///
    /// # Errors
    ///
    /// If there is no such variable of this type, or after a fault.
    pub fn string(&self, reference: u32) -> Result<&CStr, ModelError> {
        let variable = self.got(reference, Kind::String)?;
        let Meaning::File(file) = variable.meaning else { return Ok(c"") };
        Ok(self.files.path(file))
    }

    /// Sets an input, where [`MISSING`](crate::MISSING) and NaN say that it was not measured, or how
    /// the train begins.
    ///
    /// # Errors
    ///
    /// When it is no input of this type, a beginning that no train has, or in the wrong order.
    pub fn set_real(&mut self, reference: u32, value: f64) -> Result<(), ModelError> {
        let Variable { name, meaning, .. } = *self.to_be_set(reference, Kind::Real)?;
        match meaning {
            Meaning::Measured(field) => self.inputs.set(field, value),
            Meaning::Begins(begins) => {
                self.require_parameter()?;
                let beginning = with_beginning(self.beginning, begins, value);
                let expected = "a number, and no negative speed";
                self.beginning = beginning.ok_or(ModelError::BadValue { name, value, expected })?;
                self.behind = Behind::Nothing;
            }
            _ => {}
        }
        Ok(())
    }

    /// Sets the slope of an input per s, for the next step.
    ///
    /// # Errors
    ///
    /// When the model takes none, or none of this order; when it is no input of this type, or in the
    /// wrong order.
    pub fn set_slope(
        &mut self,
        reference: u32,
        (order, value): (i32, f64),
    ) -> Result<(), ModelError> {
        if !self.interface.takes_slopes {
            return Err(ModelError::NotSupported("fmi2SetRealInputDerivatives"));
        }
        if order != 1 {
            let (name, value) = ("order of a derivative", order.into());
            return Err(ModelError::BadValue { name, value, expected: "1" });
        }
        if let Meaning::Measured(field) = self.to_be_set(reference, Kind::Real)?.meaning {
            self.inputs.set_slope(field, value);
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
                self.inputs.sample.run = u32::try_from(value).map_err(|_| bad("0 or more"))?;
            }
            Meaning::Direction => {
                self.inputs.sample.direction = i8::try_from(value).map_err(|_| bad("1 or -1"))?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Sets whether wheel-slide protection is active, or whether a standing train is held.
    ///
    /// # Errors
    ///
    /// When it is no input of this type, or in the wrong order.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), ModelError> {
        if let Meaning::Begins(_) = self.to_be_set(reference, Kind::Boolean)?.meaning {
            self.require_parameter()?;
            self.beginning.is_held_at_rest = value;
            self.behind = Behind::Nothing;
        } else {
            self.inputs.sample.flags = if value { FLAG_WHEEL_SLIDE } else { 0 };
        }
        Ok(())
    }

    /// Sets the path of a file; a relative one counts from the FMU's own files.
    ///
    /// # Errors
    ///
    /// When it is no parameter of this type, or after the initialization.
    pub fn set_string(&mut self, reference: u32, value: &CStr) -> Result<(), ModelError> {
        let Variable { name, meaning, .. } = *self.to_be_set(reference, Kind::String)?;
        self.require_parameter()?;
        if value.to_str().is_err() {
            return Err(ModelError::NotText(name));
        }
        if let Meaning::File(file) = meaning {
            self.files.set(file, value);
            self.behind = Behind::Nothing;
        }
        Ok(())
    }

    fn require_parameter(&self) -> Result<(), ModelError> {
        self.require(&[Phase::Instantiated, Phase::Initializing], "to set a parameter")
    }

    fn got(&self, reference: u32, expected: Kind) -> Result<&'static Variable, ModelError> {
        let phases = [Phase::Instantiated, Phase::Initializing, Phase::Stepping, Phase::Terminated];
        self.require(&phases, "to get a variable")?;
        self.interface.variable(reference, expected)
    }

    fn to_be_set(&self, reference: u32, expected: Kind) -> Result<&'static Variable, ModelError> {
        let phases = [Phase::Instantiated, Phase::Initializing, Phase::Stepping];
        self.require(&phases, "to set a variable")?;
        let variable = self.interface.variable(reference, expected)?;
        if matches!(variable.meaning, Meaning::Estimate(..) | Meaning::Driven(_)) {
            return Err(ModelError::NotAnInput(variable.name));
        }
        Ok(variable)
    }
}

/// Returns a time in s, where it is one.
fn require_time(name: &'static str, time_s: f64) -> Result<f64, ModelError> {
    if time_s.abs() <= TIME_MAX_S {
        return Ok(time_s);
    }
    Err(ModelError::BadValue { name, value: time_s, expected: "a time in s from -9e9 to 9e9" })
}
