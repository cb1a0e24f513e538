"""Dynocar's client library for Python: publish samples, poll parameter snapshots.

    import dynocar

    with dynocar.SamplePublisher(1) as publisher, dynocar.SnapshotReader(1) as reader:
        publisher.publish(speed_mps=21.5, traction_force_n=0.0, brake_force_n=0.0)
        reader.poll()
        snapshot = reader.resistance()
        if snapshot.is_usable:
            print(snapshot.resistance_at(21.5))
        else:
            print("built-in parameters, since", snapshot.why)

One file over the shared library ``libdynocar_client.so``, with ctypes and nothing else. The rules
are those of ``dynocar.h``: no call waits for the daemon, one controller drives a train, an end
belongs to the thread that opened it, and a silent daemon shows as a stale snapshot.

The library is taken from the ``library`` argument, else from the variable ``DYNOCAR_LIBRARY``, else
from cargo's target directory (``CARGO_TARGET_DIR``, or ``target`` above this file), else from
wherever the system looks for libraries.
"""

from __future__ import annotations

import ctypes
import math
import os
import weakref
from collections import deque
from ctypes import POINTER, byref, c_char_p, c_double, c_int32, c_int64
from ctypes import c_size_t, c_uint32, c_uint64
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any, Deque, Dict, List, NamedTuple, Optional, Tuple, TypeVar, Union

PathLike = Union[str, "os.PathLike[str]"]

SCHEMA = 1
SAMPLE_LAYOUT = 0xdc0c8856b34a4c70
SNAPSHOT_LAYOUT = 0x6af21c1d0863ae21
PARAMETERS_MAX = 6
COVARIANCE_ENTRIES = 21
REJECTION_REASONS = 16
_MESSAGE_BYTES = 512
_LIBRARY_NAME = "libdynocar_client.so"


class _Vocabulary(IntEnum):
    """Numbers on the wire; a number of a later release becomes a member ``NUMBER_<n>``."""

    @classmethod
    def _missing_(cls, value: object) -> "Optional[_Vocabulary]":
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"NUMBER_{value}"
        member._value_ = value
        return member


class Code(_Vocabulary):
    """What a call of the library gives."""

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
    RESIDUAL_MONITOR = 50
    ECHO = 60


class Quantity(_Vocabulary):
    """What a controller asks for; the daemon's configuration says which pipeline answers."""

    RESISTANCE = 0
    MASS = 1
    ADHESION = 2
    BRAKE_FRICTION = 3
    BRAKING_RATIO = 4


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


class TrainSample(ctypes.Structure):
    """``dynocar_train_sample``: see ``dynocar.h`` for the fields."""

    _fields_ = [
        ("time_ns", c_int64),
        ("published_ns", c_int64),
        ("sequence", c_uint64),
        ("train_id", c_uint64),
        ("valid", ctypes.c_uint16),
        ("flags", ctypes.c_uint8),
        ("direction", ctypes.c_int8),
        ("run", c_uint32),
        ("position_m", c_double),
        ("speed_mps", c_double),
        ("traction_force_n", c_double),
        ("brake_force_n", c_double),
        ("brake_cylinder_pressure_pa", c_double),
        ("acceleration_mps2", c_double),
        ("specific_force_mps2", c_double),
        ("mass_kg", c_double),
        ("ambient_temperature_degc", c_double),
        ("gradient_permille", c_double),
        ("curve_radius_m", c_double),
    ]


class ParameterSnapshot(ctypes.Structure):
    """``dynocar_parameter_snapshot``: see ``dynocar.h`` for the fields."""

    _fields_ = [
        ("epoch", c_uint64),
        ("sequence", c_uint64),
        ("generation", c_uint64),
        ("train_id", c_uint64),
        ("pipeline_index", c_uint32),
        ("pipeline_kind", c_uint32),
        ("status", c_uint32),
        ("reason", c_uint32),
        ("quantities", c_uint32),
        ("train_quantities", c_uint32),
        ("sample_time_ns", c_int64),
        ("sample_published_ns", c_int64),
        ("published_ns", c_int64),
        ("vouched_ns", c_int64),
        ("sample_sequence", c_uint64),
        ("samples_used", c_uint64),
        ("samples_rejected", c_uint64),
        ("samples_lost", c_uint64),
        ("updates", c_uint64),
        ("rejected_by_reason", c_uint32 * REJECTION_REASONS),
        ("parameter_count", c_uint32),
        ("excited", c_uint32),
        ("missing_manoeuvres", c_uint32),
        ("suspected_effect", c_uint32),
        ("suspected_alternatives", c_uint32),
        ("suspicion_age_s", c_uint32),
        ("parameters", c_uint32 * PARAMETERS_MAX),
        ("values", c_double * PARAMETERS_MAX),
        ("covariance", c_double * COVARIANCE_ENTRIES),
        ("innovation_normalised", c_double),
        ("innovation_mean_square", c_double),
        ("innovation_correlation", c_double),
        ("unexplained_force_n", c_double),
        ("unexplained_force_std_n", c_double),
        ("suspicion_evidence", c_double),
        ("speed_min_mps", c_double),
        ("speed_max_mps", c_double),
    ]


class _Reading(ctypes.Structure):
    _fields_ = [
        ("age_ns", c_int64),
        ("status", c_uint32),
        ("reason", c_uint32),
        ("is_stale", c_uint32),
        ("is_usable", c_uint32),
        ("snapshot", ParameterSnapshot),
    ]


class _Resistance(ctypes.Structure):
    _fields_ = [
        ("w0_n_per_kn", c_double),
        ("w0_std_n_per_kn", c_double),
        ("force_n", c_double),
        ("force_std_n", c_double),
        ("is_extrapolated", c_uint64),
    ]


class StopRequest(ctypes.Structure):
    _fields_ = [
        ("from_speed_mps", c_double),
        ("to_speed_mps", c_double),
        ("mass_kg", c_double),
        ("rotating_mass_factor", c_double),
        ("gradient_permille", c_double),
        ("davis_a", c_double),
        ("davis_b", c_double),
        ("davis_c", c_double),
        ("w0_std_n_per_kn", c_double),
        ("brake_scale", c_double),
        ("brake_scale_std", c_double),
        ("adhesion", c_double),
        ("adhesion_std", c_double),
        ("rail", c_uint64),
    ]


class EffortPoint(ctypes.Structure):
    _fields_ = [
        ("speed_mps", c_double),
        ("force_n", c_double),
    ]


class Stopping(ctypes.Structure):
    _fields_ = [
        ("distance_m", c_double),
        ("time_s", c_double),
        ("distance_bound_m", c_double),
        ("time_bound_s", c_double),
    ]


class DynocarError(Exception):
    """A call that the library refused; ``code`` says why, the text says it in words."""

    def __init__(self, code: Code, words: str) -> None:
        super().__init__(words)
        self.code = code


_HANDLE = ctypes.c_void_p
_WORDS = [c_char_p, c_size_t]
_OPEN = [c_char_p, c_uint64, POINTER(_HANDLE), *_WORDS]
_LATEST = [_HANDLE, c_uint32, c_int64, POINTER(_Reading)]
_STOPPING = [
    POINTER(StopRequest),
    POINTER(EffortPoint),
    c_size_t,
    c_double,
    POINTER(Stopping),
]
_RESISTANCE = [POINTER(ParameterSnapshot), c_double, c_double, POINTER(_Resistance)]

# Name after "dynocar_", result, arguments.
_FUNCTIONS: List[Tuple[str, Any, List[Any]]] = [
    ("publisher_open", c_int32, _OPEN),
    ("publisher_start_run", c_int32, [_HANDLE]),
    ("publisher_publish", c_int32, [_HANDLE, POINTER(TrainSample)]),
    ("publisher_flush", c_int32, [_HANDLE, c_int64, POINTER(c_uint64)]),
    ("publisher_close", c_int32, [_HANDLE]),
    ("reader_open", c_int32, _OPEN),
    ("reader_set_stale_after_ns", c_int32, [_HANDLE, c_int64]),
    ("reader_poll", c_int32, [_HANDLE, POINTER(c_uint32)]),
    ("reader_quantity", c_int32, _LATEST),
    ("reader_latest", c_int32, _LATEST),
    ("reader_latest_by_index", c_int32, _LATEST),
    ("reader_refused", c_int32, [_HANDLE, POINTER(c_uint64)]),
    ("reader_close", c_int32, [_HANDLE]),
    ("snapshot_resistance", c_int32, _RESISTANCE),
    ("stopping_estimate", c_int32, _STOPPING),
    ("daemon_state", c_int32, [c_char_p, c_uint64, POINTER(c_int32), *_WORDS]),
    ("code_text", c_char_p, [c_int32]),
    ("monotonic_now_ns", c_int64, []),
    ("version", c_char_p, []),
    ("schema", c_uint32, []),
    ("sample_layout", c_uint64, []),
    ("snapshot_layout", c_uint64, []),
]


class _Library:
    """The shared library; its functions are attributes, without their prefix."""

    _loaded: Dict[str, "_Library"] = {}

    def __init__(self, path: str) -> None:
        try:
            self._dll = ctypes.CDLL(path)
        except OSError as error:
            hint = "build it with cargo build --release -p dynocar-client, or set DYNOCAR_LIBRARY"
            raise OSError(f"{error}; {hint}") from None
        for name, result, arguments in _FUNCTIONS:
            function = self.__getattr__(name)
            function.restype, function.argtypes = result, arguments
        theirs = (self.schema(), self.sample_layout(), self.snapshot_layout())
        if theirs != (SCHEMA, SAMPLE_LAYOUT, SNAPSHOT_LAYOUT):
            release = self.version().decode()
            raise ImportError(f"{path}: release {release} does not match this dynocar.py")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._dll, f"dynocar_{name}")

    @classmethod
    def load(cls, argument: Optional[PathLike]) -> "_Library":
        path = _library_path(argument)
        if path not in cls._loaded:
            cls._loaded[path] = cls(path)
        return cls._loaded[path]

    def require(self, code: int, words: bytes = b"") -> None:
        if code != Code.OK:
            text = words or self.code_text(code)
            raise DynocarError(Code(code), text.decode(errors="replace"))


def _library_path(argument: Optional[PathLike]) -> str:
    named = argument or os.environ.get("DYNOCAR_LIBRARY")
    if named:
        return os.fspath(named)
    targets = [Path(__file__).resolve().parents[2] / "target"]
    if os.environ.get("CARGO_TARGET_DIR"):
        targets.insert(0, Path(os.environ["CARGO_TARGET_DIR"]))
    for target in targets:
        path = target / "release" / _LIBRARY_NAME
        if path.is_file():
            return str(path)
    return _LIBRARY_NAME


def _root_bytes(root: Optional[PathLike]) -> Optional[bytes]:
    return None if root is None else os.fsencode(root)


class Resistance(NamedTuple):
    """Basic resistance at a speed, with standard deviations."""

    w0_n_per_kn: float
    w0_std_n_per_kn: float
    force_n: float
    force_std_n: float
    is_extrapolated: bool


class Snapshot:
    """A pipeline's knowledge of one train at one moment, with its age.

    ``raw`` holds every field of ``dynocar_parameter_snapshot``. ``code`` is ``OK``, or why there is
    none: ``NO_SNAPSHOT`` or ``NOT_PROVIDED``; then nothing may be used.
    """

    def __init__(self, library: _Library, reading: _Reading, code: Code = Code.OK) -> None:
        self._library = library
        self.code = code
        self.raw: ParameterSnapshot = reading.snapshot
        self.age_ns: int = reading.age_ns
        self.status = Status(reading.status)
        self.reason = Reason(reading.reason)
        self.is_stale = bool(reading.is_stale)
        self.is_usable = bool(reading.is_usable)

    def _or_none(self) -> "Optional[Snapshot]":
        return self if self.code == Code.OK else None

    @property
    def why(self) -> str:
        """Why, in one word: the reason, ``no_snapshot`` or ``not_provided``."""
        return (self.reason if self.code == Code.OK else self.code).name.lower()

    @property
    def pipeline_kind(self) -> PipelineKind:
        """The estimator's kind."""
        return PipelineKind(self.raw.pipeline_kind)

    @property
    def parameters(self) -> List[Parameter]:
        """The estimated parameters, in the order of the covariance matrix."""
        count = min(self.raw.parameter_count, PARAMETERS_MAX)
        return [Parameter(number) for number in self.raw.parameters[:count]]

    @property
    def values(self) -> Dict[Parameter, float]:
        """The parameters' values in their units."""
        return dict(zip(self.parameters, self.raw.values))

    def covariance(self, parameter: Parameter, other: Parameter) -> float:
        """Covariance of two parameters, in the product of their units.

        Raises ``KeyError`` for a parameter that the pipeline does not estimate.
        """
        places = {name: place for place, name in enumerate(self.parameters)}
        column, row = sorted((places[parameter], places[other]))
        return float(self.raw.covariance[row * (row + 1) // 2 + column])

    def std(self, parameter: Parameter) -> float:
        """Standard deviation of a parameter in its unit; ``KeyError`` as in ``covariance``."""
        return math.sqrt(max(self.covariance(parameter, parameter), 0.0))

    @property
    def covariance_matrix(self) -> List[List[float]]:
        """The full symmetric matrix, in the order of ``parameters``."""
        names = self.parameters
        return [[self.covariance(row, column) for column in names] for row in names]

    @property
    def excited(self) -> Dict[Parameter, bool]:
        """Whether the data excited each parameter."""
        bits = self.raw.excited
        return {name: bool(bits >> place & 1) for place, name in enumerate(self.parameters)}

    @property
    def missing_manoeuvres(self) -> Manoeuvre:
        """Manoeuvres that would excite the other parameters."""
        return Manoeuvre(self.raw.missing_manoeuvres)

    @property
    def suspected_effect(self) -> Effect:
        """The effect that the model may lack."""
        return Effect(self.raw.suspected_effect)

    @property
    def suspected_alternatives(self) -> List[Effect]:
        """Other effects that these data hardly tell from the suspected one."""
        bits = self.raw.suspected_alternatives
        return [effect for effect in Effect if bits >> effect & 1]

    @property
    def suspicion_age_s(self) -> int:
        """How long the suspicion has stood, in s."""
        return self.raw.suspicion_age_s

    @property
    def rejected(self) -> Dict[RejectionReason, int]:
        """Samples refused, by reason; reasons that never occurred are left out."""
        counts = enumerate(self.raw.rejected_by_reason)
        return {RejectionReason(number): count for number, count in counts if count}

    def resistance_at(self, speed_mps: float, mass_kg: float = 0.0) -> Optional[Resistance]:
        """Basic resistance at a speed, in N for a train of ``mass_kg``.

        ``None`` unless the pipeline estimates all three Davis coefficients.
        """
        place = _Resistance()
        code = self._library.snapshot_resistance(byref(self.raw), speed_mps, mass_kg, byref(place))
        if code == Code.NOT_IN_SNAPSHOT:
            return None
        self._library.require(code)
        return Resistance(
            place.w0_n_per_kn,
            place.w0_std_n_per_kn,
            place.force_n,
            place.force_std_n,
            bool(place.is_extrapolated),
        )


_Self = TypeVar("_Self", bound="_End")


# Ends that were dropped in another thread than their own, which alone may close them.
_dropped_elsewhere: Deque[Tuple[_Library, str, ctypes.c_void_p]] = deque()


def _close_dropped(library: _Library, kind: str, handle: ctypes.c_void_p) -> None:
    """Closes an end that nobody holds any more, or leaves it to its own thread."""
    if getattr(library, f"{kind}_close")(handle) == Code.WRONG_THREAD:
        _dropped_elsewhere.append((library, kind, handle))


def _close_what_this_thread_dropped() -> None:
    for _ in range(len(_dropped_elsewhere)):
        try:
            dropped = _dropped_elsewhere.popleft()
        except IndexError:  # another thread was faster
            return
        _close_dropped(*dropped)


class _End:
    """One end of a channel; close it, or use it in a ``with`` statement.

    An end that is dropped is closed. One that another thread drops is closed when its own thread
    opens the next end.
    """

    _kind = ""

    def __init__(
        self,
        train_id: int,
        root: Optional[PathLike] = None,
        library: Optional[PathLike] = None,
    ) -> None:
        """Opens the end for a train; the daemon need not run yet.

        ``root`` is the run-time directory; ``None`` takes it from the variable ``DYNOCAR_ROOT``,
        else ``/tmp/dynocar-<user id>``. Raises ``DynocarError`` with the reason in words.
        """
        self._library = _Library.load(library)
        self._handle: Optional[ctypes.c_void_p] = None
        _close_what_this_thread_dropped()
        handle, words = ctypes.c_void_p(), ctypes.create_string_buffer(_MESSAGE_BYTES)
        open_end = getattr(self._library, f"{self._kind}_open")
        code = open_end(_root_bytes(root), train_id, byref(handle), words, len(words))
        self._library.require(code, words.value)
        self._handle = handle
        self._finalizer = weakref.finalize(self, _close_dropped, self._library, self._kind, handle)

    def close(self) -> None:
        """Closes the end; a closed one stays closed."""
        if self._handle is not None:
            self._call("close")
            self._finalizer.detach()
            self._handle = None

    def _call(self, function: str, *arguments: Any) -> None:
        if self._handle is None:
            raise ValueError(f"the {self._kind} is closed")
        call = getattr(self._library, f"{self._kind}_{function}")
        self._library.require(call(self._handle, *arguments))

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class SamplePublisher(_End):
    """Publishes one train's samples; a second one for the same train is refused."""

    _kind = "publisher"

    def start_run(self) -> None:
        """Starts a new run (trip): filters do not integrate across."""
        self._call("start_run")

    def publish(
        self,
        *,
        time_ns: Optional[int] = None,
        direction: int = 1,
        wheel_slide: bool = False,
        position_m: Optional[float] = None,
        speed_mps: Optional[float] = None,
        traction_force_n: Optional[float] = None,
        brake_force_n: Optional[float] = None,
        brake_cylinder_pressure_pa: Optional[float] = None,
        acceleration_mps2: Optional[float] = None,
        specific_force_mps2: Optional[float] = None,
        mass_kg: Optional[float] = None,
        ambient_temperature_degc: Optional[float] = None,
        gradient_permille: Optional[float] = None,
        curve_radius_m: Optional[float] = None,
    ) -> int:
        """Publishes a sample and gives its sequence number; ``None`` is a missing value.

        ``time_ns`` is when the values were measured, on the controller's monotonic clock; without
        it, the time of the call.
        """
        sample = TrainSample()
        sample.time_ns = self._library.monotonic_now_ns() if time_ns is None else time_ns
        sample.direction = direction
        sample.flags = 1 if wheel_slide else 0
        quantities: List[Tuple[Has, str, Optional[float]]] = [
            (Has.POSITION, "position_m", position_m),
            (Has.SPEED, "speed_mps", speed_mps),
            (Has.TRACTION_FORCE, "traction_force_n", traction_force_n),
            (Has.BRAKE_FORCE, "brake_force_n", brake_force_n),
            (Has.BRAKE_CYLINDER_PRESSURE, "brake_cylinder_pressure_pa", brake_cylinder_pressure_pa),
            (Has.ACCELERATION, "acceleration_mps2", acceleration_mps2),
            (Has.SPECIFIC_FORCE, "specific_force_mps2", specific_force_mps2),
            (Has.MASS, "mass_kg", mass_kg),
            (Has.AMBIENT_TEMPERATURE, "ambient_temperature_degc", ambient_temperature_degc),
            (Has.GRADIENT, "gradient_permille", gradient_permille),
            (Has.CURVE_RADIUS, "curve_radius_m", curve_radius_m),
        ]
        for bit, field, value in quantities:
            if value is not None:
                setattr(sample, field, value)
                sample.valid |= bit
        self._call("publish", byref(sample))
        return int(sample.sequence)

    def flush(self, patience_s: float = 0.2) -> int:
        """Waits until every pipeline has taken every sample; gives the number not taken.

        ``close`` waits up to 0.2 s unless this has waited since the last sample. Not for the
        control cycle.
        """
        not_taken = c_uint64()
        self._call("flush", int(patience_s * 1e9), byref(not_taken))
        return not_taken.value


class SnapshotReader(_End):
    """Reads the newest snapshot of each pipeline of one train."""

    _kind = "reader"

    def set_stale_after_ns(self, stale_after_ns: int) -> None:
        """Sets the age from which a snapshot counts as stale; 250 ms at first."""
        self._call("set_stale_after_ns", stale_after_ns)

    def poll(self) -> int:
        """Takes what has come since; gives the number of snapshots that told something new."""
        news = c_uint32()
        self._call("poll", byref(news))
        return news.value

    def quantity(self, quantity: Quantity, now_ns: Optional[int] = None) -> Snapshot:
        """The newest polled snapshot of the pipeline that answers a quantity.

        Which one that is says the daemon's configuration. Gives a snapshot that is not usable, with
        its ``code``, when none has come yet or no pipeline answers. ``now_ns`` as in ``latest``.
        """
        return self._snapshot("quantity", quantity, now_ns)

    def resistance(self, now_ns: Optional[int] = None) -> Snapshot:
        """``quantity`` for resistance: see ``resistance_at``."""
        return self.quantity(Quantity.RESISTANCE, now_ns)

    def mass(self, now_ns: Optional[int] = None) -> Snapshot:
        """``quantity`` for the gross mass: ``Parameter.MASS`` in t."""
        return self.quantity(Quantity.MASS, now_ns)

    def adhesion(self, now_ns: Optional[int] = None) -> Snapshot:
        """``quantity`` for adhesion: ``Parameter.ADHESION`` or ``ADHESION_LOWER_BOUND``."""
        return self.quantity(Quantity.ADHESION, now_ns)

    def brake_friction(self, now_ns: Optional[int] = None) -> Snapshot:
        """``quantity`` for ``Parameter.DISC_FRICTION``, the declared braking ratio held."""
        return self.quantity(Quantity.BRAKE_FRICTION, now_ns)

    def braking_ratio(self, now_ns: Optional[int] = None) -> Snapshot:
        """``quantity`` for ``Parameter.BRAKING_RATIO``, the declared friction held."""
        return self.quantity(Quantity.BRAKING_RATIO, now_ns)

    def latest(self, kind: PipelineKind, now_ns: Optional[int] = None) -> Optional[Snapshot]:
        """The newest polled snapshot of the first pipeline of a kind, ``None`` before the first.

        ``now_ns`` is the host's monotonic clock; without it, the time of the call.
        """
        return self._snapshot("latest", kind, now_ns)._or_none()

    def latest_by_index(self, index: int, now_ns: Optional[int] = None) -> Optional[Snapshot]:
        """The same, by the pipeline's number in the daemon's configuration."""
        return self._snapshot("latest_by_index", index, now_ns)._or_none()

    def _snapshot(self, function: str, number: int, now_ns: Optional[int]) -> Snapshot:
        reading, code = _Reading(), Code.OK
        now_ns = self._library.monotonic_now_ns() if now_ns is None else now_ns
        try:
            self._call(function, number, now_ns, byref(reading))
        except DynocarError as error:
            if error.code not in (Code.NO_SNAPSHOT, Code.NOT_PROVIDED):
                raise
            code = error.code
        return Snapshot(self._library, reading, code)

    @property
    def refused(self) -> int:
        """Messages that no sane daemon would send: foreign train, NaN and the like."""
        count = c_uint64()
        self._call("refused", byref(count))
        return count.value


def daemon_state(
    train_id: int,
    root: Optional[PathLike] = None,
    library: Optional[PathLike] = None,
) -> Tuple[DaemonState, str]:
    """Who serves a train, as a state and in words."""
    loaded = _Library.load(library)
    state, words = c_int32(), ctypes.create_string_buffer(_MESSAGE_BYTES)
    code = loaded.daemon_state(_root_bytes(root), train_id, byref(state), words, len(words))
    loaded.require(code, words.value)
    return DaemonState(state.value), words.value.decode(errors="replace")


def monotonic_now_ns(library: Optional[PathLike] = None) -> int:
    """The host's monotonic clock in ns since boot, common to all its processes."""
    return int(_Library.load(library).monotonic_now_ns())


def version(library: Optional[PathLike] = None) -> str:
    """The library's release."""
    return str(_Library.load(library).version(), "ascii")
