"""The numbers on the channels and their names."""

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
    """Why a call on a channel was refused."""

    OK = 0
    NULL_ARGUMENT = 1
    BAD_NUMBER = 2
    WRONG_THREAD = 3
    ROOT_NAME = 4
    DIRECTORY = 5
    OCCUPIED = 6
    INCOMPATIBLE_DAEMON = 7
    TRANSPORT = 8
    SEND_REFUSED = 9
    NO_SNAPSHOT = 10
    NOT_IN_SNAPSHOT = 11
    PANIC = 12
    DOES_NOT_STOP = 13
    NOT_PROVIDED = 14
    NO_PLACE_LEFT = 15


class Rail(_Vocabulary):
    """What the rail carries in a stop."""

    UNLIMITED = 0
    COEFFICIENT = 1
    DRY_LAW = 2
    WET_LAW = 3


class DaemonState(_Vocabulary):
    """Who serves a train."""

    ABSENT = 0
    COMPATIBLE = 1
    INCOMPATIBLE = 2


class Status(_Vocabulary):
    """What a controller may do with an estimate: only ``ESTIMATED`` values may be used.

    ``docs/guides/reading.md`` tells what each status and each reason means.
    """

    UNESTIMATED = 1
    ESTIMATED = 2
    DEGRADED = 3
    INVALID = 4


class Reason(_Vocabulary):
    """Why a status is what it is."""

    NONE = 0
    TOO_FEW_SAMPLES = 1
    WEAK_EXCITATION = 2
    AT_BOUND = 3
    INNOVATIONS_TOO_LARGE = 4
    INNOVATIONS_NOT_WHITE = 5
    BAD_INPUT = 6
    MISSING_QUANTITY = 7
    GRADIENT_UNKNOWN = 8
    NUMERICAL_FAILURE = 9
    ESTIMATE_STALE = 11
    ONLY_LOWER_BOUND = 12
    NOT_IDENTIFIABLE = 13
    DAEMON_SILENT = 14
    IMPLAUSIBLE_FORCES = 15
    IMPLAUSIBLE_MOTION = 16
    IMPLAUSIBLE_MASS = 17
    IMPLAUSIBLE_GRADIENT = 18
    IMPLAUSIBLE_PRESSURE = 19


class PipelineKind(_Vocabulary):
    """The kind of estimator behind a snapshot."""

    LS = 1
    LEAST_SQUARES = 1  # its name in earlier releases
    RLS = 2
    REGULARISED_RLS = 3
    MILS = 4
    V_MILS = 5
    TRAJECTORY_NEWTON = 10
    TRAJECTORY_KALMAN = 11
    RESISTANCE_KALMAN = 12
    ADHESION_EM = 20
    ADHESION_EKF = 21
    ADHESION_SMOOTHER = 22
    ADHESION_LAW = 23
    BRAKE_EM = 30
    BRAKE_EKF = 31
    BRAKE_SMOOTHER = 32
    STAGED_DESCENT = 40
    JOINT_LEAST_SQUARES = 41
    MASS_KALMAN = 42
    TRAIN_KALMAN = 43
    RESIDUAL_MONITOR = 50
    ECHO = 60


class Quantity(_Vocabulary):
    """What a controller asks for; the daemon's configuration says which pipeline answers."""

    RESISTANCE = 0
    MASS = 1
    ADHESION = 2
    BRAKE_FRICTION = 3
    BRAKING_RATIO = 4


class MassSource(_Vocabulary):
    """Where the mass in a snapshot comes from."""

    NONE = 0
    DECLARED = 1
    WEIGHED = 2
    LEARNED = 3


class Parameter(_Vocabulary):
    """A number that a pipeline estimates."""

    DAVIS_A = 1  # N/kN
    DAVIS_B = 2  # N/kN per m/s
    DAVIS_C = 3  # N/kN per (m/s)^2
    MASS = 5  # t
    ADHESION = 6
    ADHESION_LOWER_BOUND = 7
    ADHESION_LAW_SCALE = 8
    DISC_FRICTION = 9
    BRAKING_RATIO = 10
    ACCELERATION_BIAS = 14  # m/s^2
    UNEXPLAINED_FORCE = 15  # N


class RejectionReason(_Vocabulary):
    """Why a sample was not used."""

    TIME_NOT_INCREASING = 0
    TIME_JUMP = 1
    SEQUENCE_NOT_INCREASING = 2
    WRONG_TRAIN = 3
    MISSING = 4
    NOT_FINITE = 5
    SPEED_OUT_OF_RANGE = 6
    SPEED_JUMP = 7
    POSITION_JUMP = 8
    FORCE_OUT_OF_RANGE = 9
    MASS_OUT_OF_RANGE = 10
    BAD_DIRECTION = 11
    OUTLIER = 12
    WHEEL_SLIDE = 13
    OUT_OF_RANGE = 14
    FROZEN = 15


class Manoeuvre(IntFlag):
    """Manoeuvres that would tell more."""

    COAST_SLOW = 1 << 0
    COAST_FAST = 1 << 1
    VARY_SPEED = 1 << 2
    ACCELERATE = 1 << 3
    BRAKE = 1 << 4
    MOVE = 1 << 5


class Effect(_Vocabulary):
    """An effect that the model may lack."""

    NONE = 0
    TUNNEL_DRAG = 1
    CURVE_RESISTANCE = 2
    WIND = 3
    DRAGGING_BRAKE = 4
    WHEEL_DIAMETER = 5
    GRADIENT_SHIFT = 6
    MASS_CHANGE = 7
    TRACTION_GAIN = 8
    ACTUATOR_DELAY = 9
    ROTATING_MASS = 10
    BEARING_TEMPERATURE = 11
    AMBIENT_TEMPERATURE = 12
    LOCAL_RESISTANCE = 13
    LOW_ADHESION = 14
    UNKNOWN = 15
    GRADIENT_ERROR = 16
    SPEED_DELAY = 17


class Has(IntFlag):
    """Measured quantities of a sample."""

    POSITION = 1 << 0
    SPEED = 1 << 1
    TRACTION_FORCE = 1 << 2
    BRAKE_FORCE = 1 << 3
    BRAKE_CYLINDER_PRESSURE = 1 << 4
    ACCELERATION = 1 << 5
    SPECIFIC_FORCE = 1 << 6
    MASS = 1 << 7
    AMBIENT_TEMPERATURE = 1 << 8
    GRADIENT = 1 << 9
    CURVE_RADIUS = 1 << 10
