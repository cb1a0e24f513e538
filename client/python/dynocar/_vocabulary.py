"""The numbers on the channels and their names: written by client/tests/client/bindings.rs from the Rust types."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class _Vocabulary(IntEnum):
    """Numbers on the wire; a number of a later release becomes a member ``NUMBER_<n>``."""

    @classmethod
    def _missing_(cls, value: object) -> _Vocabulary | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"NUMBER_{value}"
        member._value_ = value
        return member


class Code(_Vocabulary):
    """What every function that can fail gives."""

    OK = 0  # Done
    NULL_ARGUMENT = 1  # A pointer that must not be NULL is NULL
    BAD_NUMBER = 2  # A number that means nothing or lies out of range, or that is not finite
    WRONG_THREAD = 3  # The handle belongs to the thread that opened it
    ROOT_NAME = 4  # The root directory's name cannot be used: not absolute, too long, or special characters
    DIRECTORY = 5  # A run-time directory or file cannot be used
    OCCUPIED = 6  # Another process drives the train
    INCOMPATIBLE_DAEMON = 7  # The daemon there speaks another schema, layout or transport version
    TRANSPORT = 8  # The shared memory cannot be used
    SEND_REFUSED = 9  # The sample was not taken and counts as lost; just go on
    NO_SNAPSHOT = 10  # No snapshot of this pipeline has come yet
    NOT_IN_SNAPSHOT = 11  # The snapshot's pipeline does not estimate this parameter
    PANIC = 12  # A fault inside the library, in words on standard error: close the handle
    DOES_NOT_STOP = 13  # The train does not slow down, at the values given or at the edge of the bound
    NOT_PROVIDED = 14  # The daemon's configuration lets no pipeline answer this quantity for the train
    NO_PLACE_LEFT = 15  # Every place of the train's channel is taken: close the ends that are no longer needed
    FORKED_PROCESS = 16  # The handle was opened before fork(), in the parent: its ends are the parent's
    ROOT_GONE = 17  # The root directory was removed or replaced: close all ends and open them again
    SEPARATE_MEMORY = 18  # The daemon, or the controller, has a /dev/shm of its own: containers have to share one


class Rail(_Vocabulary):
    """What the rail carries in a stop."""

    UNLIMITED = 0  # Any brake force: adhesion and its standard deviation are not read
    COEFFICIENT = 1  # Adhesion is one coefficient at all speeds, or a lower bound of it
    DRY_LAW = 2  # Adhesion is a scale of the dry rail's law (Xie 2019)
    WET_LAW = 3  # Adhesion is a scale of the wet rail's law (Xie 2019)


class DaemonState(_Vocabulary):
    """Who serves a train."""

    ABSENT = 0  # Nobody serves the train
    COMPATIBLE = 1  # A living daemon serves it
    INCOMPATIBLE = 2  # A living daemon serves it, and we cannot understand each other


class Status(_Vocabulary):
    """How the estimate of a pipeline stands as a whole. ``UseState`` says what may be used.

    ``docs/guides/reading.md`` says what each status and each reason means.
    """

    UNESTIMATED = 1  # Some estimated values are not known yet; these are declared, kept or initial
    ESTIMATED = 2  # All that is estimated is known
    DEGRADED = 3  # There are values, with a reservation named by the reason
    INVALID = 4  # The values must not be used


class UseState(_Vocabulary):
    """Whether a controller may use the values for what it asked for, in one word."""

    USABLE = 1  # The values may be used, independent of the status of the estimate as a whole
    LEARNING = 2  # Not known well enough yet
    CONFIRMING = 3  # Known, and held back until it has held for a while without doubt
    DOUBTED = 4  # Something speaks against the values or the samples
    UNAVAILABLE = 5  # There are no values: the daemon is silent, or the estimate has failed


class Reason(_Vocabulary):
    """Why a status is what it is."""

    NONE = 0  # Nothing to remark
    TOO_FEW_SAMPLES = 1  # Too few samples were used
    WEAK_EXCITATION = 2  # Some parameter directions were not excited by the data
    AT_BOUND = 3  # A parameter lies at a physical bound
    INNOVATIONS_TOO_LARGE = 4  # The innovations are larger than their covariance says
    INNOVATIONS_NOT_WHITE = 5  # The innovations are correlated: the model lacks something
    BAD_INPUT = 6  # A large share of the samples is rejected or lost
    MISSING_QUANTITY = 7  # The samples lack a quantity that the pipeline needs
    GRADIENT_UNKNOWN = 8  # No gradient is known: neither track nor sample gives one
    NUMERICAL_FAILURE = 9  # A factorisation failed; the filter was reset
    ESTIMATE_STALE = 11  # The last manoeuvre that could excite the parameter lies too far back
    ONLY_LOWER_BOUND = 12  # Only a lower bound can be had from these data
    NOT_IDENTIFIABLE = 13  # The same data fit other values of the parameters as well
    DAEMON_SILENT = 14  # The daemon has not been heard of lately; set by the client, never by the daemon
    IMPLAUSIBLE_FORCES = 15  # Forces that cannot be true: a wrong unit, exchanged, of the wrong sign, refreshed too seldom
    IMPLAUSIBLE_MOTION = 16  # Speed, position, time or direction that contradict each other: a wrong unit or sign
    IMPLAUSIBLE_MASS = 17  # A mass that cannot be true: a wrong unit
    IMPLAUSIBLE_GRADIENT = 18  # A gradient that cannot be true: a wrong unit or sign
    IMPLAUSIBLE_PRESSURE = 19  # A brake-cylinder pressure that cannot be true: a wrong unit
    LOAD_MAY_HAVE_CHANGED = 20  # The train stood so long that the load may have changed; its interval allows for that


class PipelineKind(_Vocabulary):
    """The kind of estimator behind a snapshot, named as in the configuration."""

    LS = 1  # Regularised least squares over all windows (Liu 2018, eq. 7)
    LEAST_SQUARES = 1  # its name in earlier releases
    RLS = 2  # Recursive least squares (Liu 2018, eq. 9-11)
    REGULARISED_RLS = 3  # Regularised recursive least squares (Liu 2018, eq. 12-16)
    MILS = 4  # Multi-innovation least squares, regularised (Liu 2018)
    V_MILS = 5  # Interval-varying multi-innovation least squares, regularised (Liu 2018)
    TRAJECTORY_NEWTON = 10  # Trajectory fit by Wolfe-Newton over a sliding window (Xia 2023)
    TRAJECTORY_KALMAN = 11  # Kalman filter v, a, b, c with jump hypotheses
    RESISTANCE_KALMAN = 12  # Robust resistance filter with a disturbance state
    ADHESION_EM = 20  # Adhesion by sliding-window expectation maximisation (Xie 2019)
    ADHESION_EKF = 21  # Adhesion by extended Kalman filter (the baseline of Xie 2019)
    ADHESION_SMOOTHER = 22  # Adhesion by fixed-lag smoothing of the effective deceleration
    ADHESION_LAW = 23  # Adhesion as the scale of a known law
    BRAKE_EM = 30  # Brake-disc friction times braking ratio by expectation maximisation (Jin 2020)
    BRAKE_EKF = 31  # Brake-disc friction times braking ratio by extended Kalman filter (Jin 2020's baseline)
    BRAKE_SMOOTHER = 32  # Brake-disc friction times braking ratio by fixed-lag smoothing
    STAGED_DESCENT = 40  # Staged gradient descent for resistance and mass (Wang 2022)
    JOINT_LEAST_SQUARES = 41  # Joint integral least squares for resistance and mass
    MASS_KALMAN = 42  # Kalman filter v, 1/m, bias for mass
    TRAIN_KALMAN = 43  # Kalman filters of resistance and mass together
    RESIDUAL_MONITOR = 50  # Watches the residual between model and measurement
    ECHO = 60  # Copies sample to snapshot without estimating: the latency floor


class Quantity(_Vocabulary):
    """What a controller asks for; the daemon's configuration says which pipeline answers."""

    RESISTANCE = 0  # Basic resistance over speed: Davis a, b and c
    MASS = 1  # Gross mass
    ADHESION = 2  # Adhesion of wheel on rail
    BRAKE_FRICTION = 3  # Friction of the brake discs, the declared braking ratio held
    BRAKING_RATIO = 4  # Braking ratio, the declared friction held


class MassSource(_Vocabulary):
    """Where the mass in a snapshot comes from."""

    NONE = 0  # The pipeline estimates no mass
    DECLARED = 1  # The train's file: nothing else is known of the load yet
    WEIGHED = 2  # The controller's samples, which carry it
    LEARNED = 3  # Effect of forces on the train


class Parameter(_Vocabulary):
    """A number that a pipeline estimates, with the unit of its value."""

    DAVIS_A = 1  # Davis a in N/kN
    DAVIS_B = 2  # Davis b in N/kN per m/s
    DAVIS_C = 3  # Davis c in N/kN per (m/s)^2
    MASS = 5  # Mass in t
    ADHESION = 6  # Wheel-rail adhesion coefficient
    ADHESION_LOWER_BOUND = 7  # A lower bound of the adhesion coefficient
    ADHESION_LAW_SCALE = 8  # Scale of the known adhesion law
    DISC_FRICTION = 9  # Brake-disc friction coefficient
    BRAKING_RATIO = 10  # Braking ratio
    ACCELERATION_BIAS = 14  # Acceleration bias in m/s^2
    UNEXPLAINED_FORCE = 15  # Unexplained force in N


class RejectionReason(_Vocabulary):
    """Why a sample was not used: places in rejected_by_reason."""

    TIME_NOT_INCREASING = 0  # The time is not later than the last accepted one
    TIME_JUMP = 1  # The time jumped ahead by more than a motion segment allows
    SEQUENCE_NOT_INCREASING = 2  # The sequence number repeats or runs backwards
    WRONG_TRAIN = 3  # The sample is of another train
    MISSING = 4  # A quantity that is needed is missing
    NOT_FINITE = 5  # A quantity is NaN or infinite
    SPEED_OUT_OF_RANGE = 6  # The speed lies outside the train's range
    SPEED_JUMP = 7  # The speed changed faster than a train can
    POSITION_JUMP = 8  # The position disagrees with the speed or lies off the line
    FORCE_OUT_OF_RANGE = 9  # A force lies outside the range that the train can exert
    MASS_OUT_OF_RANGE = 10  # The mass lies outside the train's range
    BAD_DIRECTION = 11  # The direction is neither +1 nor -1
    OUTLIER = 12  # The estimator's outlier test refused the window
    WHEEL_SLIDE = 13  # Wheel slide or wheel spin: the speed is not the train's
    OUT_OF_RANGE = 14  # Another quantity lies outside its physical range
    REPEATED = 15  # The sample before once more, or the same speed, place and forces of a moving train for more than 2.5 s


class Manoeuvre(IntFlag):
    """Manoeuvres that would show more: bits of missing_manoeuvres."""

    COAST_SLOW = 1 << 0  # Coasting at low speed, which determines Davis a
    COAST_FAST = 1 << 1  # Coasting at high speed, which determines Davis c
    VARY_SPEED = 1 << 2  # A wider range of speeds, which separates a, b and c
    ACCELERATE = 1 << 3  # Strong traction, which determines mass
    BRAKE = 1 << 4  # Strong braking, which determines adhesion and brake friction
    MOVE = 1 << 5  # Any motion


class Effect(_Vocabulary):
    """An effect that the model may lack."""

    NONE = 0  # No suspicion
    TUNNEL_DRAG = 1  # Air drag in tunnels
    CURVE_RESISTANCE = 2  # Resistance in curves
    WIND = 3  # Wind along the line
    DRAGGING_BRAKE = 4  # A brake that does not release
    WHEEL_DIAMETER = 5  # A wrong wheel diameter, hence a wrong speed scale
    GRADIENT_SHIFT = 6  # A gradient profile moved along the line
    MASS_CHANGE = 7  # Another mass than declared
    TRACTION_GAIN = 8  # A reported force that is not the true one
    ACTUATOR_DELAY = 9  # Forces that act later than reported
    ROTATING_MASS = 10  # Another rotating mass than declared
    BEARING_TEMPERATURE = 11  # Cold bearings that warm up
    AMBIENT_TEMPERATURE = 12  # Resistance that follows the outside temperature
    LOCAL_RESISTANCE = 13  # Extra resistance at a place
    LOW_ADHESION = 14  # A brake force that the rail does not carry
    UNKNOWN = 15  # A real residual that no known effect explains
    GRADIENT_ERROR = 16  # A declared gradient that is wrong by a smooth function of the chainage
    SPEED_DELAY = 17  # A measured speed that is late
    BRAKE_GAIN = 18  # A brake that is weaker or stronger than reported
    BRAKE_DELAY = 19  # A brake that acts later than reported, while traction does not


class Has(IntFlag):
    """Measured quantities of a sample: bits of valid."""

    POSITION = 1 << 0  # position_m
    SPEED = 1 << 1  # speed_mps
    TRACTION_FORCE = 1 << 2  # traction_force_n
    BRAKE_FORCE = 1 << 3  # brake_force_n
    BRAKE_CYLINDER_PRESSURE = 1 << 4  # brake_cylinder_pressure_pa
    ACCELERATION = 1 << 5  # acceleration_mps2
    SPECIFIC_FORCE = 1 << 6  # specific_force_mps2
    MASS = 1 << 7  # mass_kg
    AMBIENT_TEMPERATURE = 1 << 8  # ambient_temperature_degc
    GRADIENT = 1 << 9  # gradient_permille
    CURVE_RADIUS = 1 << 10  # curve_radius_m
