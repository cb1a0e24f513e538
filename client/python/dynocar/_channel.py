"""The two ends that a controller holds: publish samples, poll parameter snapshots.

No call waits for the daemon, one controller drives a train, an end belongs to the thread that opened
it, and a silent daemon shows as a stale snapshot.
"""

from __future__ import annotations

import math
import os
from types import TracebackType
from typing import NamedTuple, TypeVar

from . import _native
from ._vocabulary import (
    Code,
    DaemonState,
    Effect,
    Manoeuvre,
    Parameter,
    PipelineKind,
    Quantity,
    Reason,
    RejectionReason,
    Status,
    UseState,
)

PathLike = str | os.PathLike[str]


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
    none: ``NO_SNAPSHOT`` or ``NOT_PROVIDED``; then nothing may be used. ``print`` shows status, reason
    and the values with their 95 % intervals and units, ``repr`` the same on one line.
    """

    def __init__(self, reading: _native.Reading) -> None:
        self.code = Code(reading.code)
        self.raw = reading.snapshot
        self.age_ns = reading.age_ns
        self.status = Status(reading.status)
        self.reason = Reason(reading.reason)
        self.is_stale = reading.is_stale
        self.is_usable = reading.is_usable
        self.use_state = UseState(reading.use_state)
        self._why = reading.why

    def __repr__(self) -> str:
        values = ", ".join(f"{name} {words}" for name, words in self._intervals())
        return f"<Snapshot {self._verdict()}{': ' if values else ''}{values}>"

    def __str__(self) -> str:
        rows = self._intervals()
        width = max((len(name) for name, _ in rows), default=0)
        lines = [self._verdict(), *(f"    {name:<{width}}  {words}" for name, words in rows)]
        if rows:
            lines.append("± is the half width of the 95 % interval")
        return "\n".join(lines)

    def _verdict(self) -> str:
        """Which pipeline, its status with the reason, and whether the values may be used."""
        if self.code != Code.OK:
            return f"{self.why}, not usable"
        reason = "" if self.reason == Reason.NONE else f" ({self.reason.name.lower()})"
        use = "usable" if self.is_usable else f"not usable ({self.use_state.name.lower()})"
        return f"{self.pipeline_kind.name.lower()} {self.status.name.lower()}{reason}, {use}"

    def _intervals(self) -> list[tuple[str, str]]:
        """Each parameter's name, and its value with interval and unit."""
        if self.code != Code.OK:
            return []
        return [
            (name.name.lower(), _with_interval(value, self.std(name), _native.parameter_unit(name)))
            for name, value in self.values.items()
        ]

    def _or_none(self) -> Snapshot | None:
        return self if self.code == Code.OK else None

    @property
    def why(self) -> str:
        """Why, in one word: the reason, ``no_snapshot`` or ``not_provided``.

        ``confirming`` is what is known and held back until it has held; ``none`` stands only beside what
        is usable.
        """
        return self._why if self.code == Code.OK else self.code.name.lower()

    @property
    def pipeline_kind(self) -> PipelineKind:
        """The estimator's kind."""
        return PipelineKind(self.raw.pipeline_kind)

    @property
    def parameters(self) -> list[Parameter]:
        """The estimated parameters, in the order of the covariance matrix."""
        numbers = self.raw.parameters
        return [Parameter(number) for number in numbers[: self.raw.parameter_count]]

    @property
    def values(self) -> dict[Parameter, float]:
        """The parameters' values in their units."""
        return dict(zip(self.parameters, self.raw.values))

    def covariance(self, parameter: Parameter, other: Parameter) -> float:
        """Covariance of two parameters, in the product of their units.

        Raises ``KeyError`` for a parameter that the pipeline does not estimate.
        """
        places = {name: place for place, name in enumerate(self.parameters)}
        column, row = sorted((places[parameter], places[other]))
        return self.raw.covariance[row * (row + 1) // 2 + column]

    def std(self, parameter: Parameter) -> float:
        """Standard deviation of a parameter in its unit; ``KeyError`` as in ``covariance``."""
        return math.sqrt(max(self.covariance(parameter, parameter), 0.0))

    @property
    def covariance_matrix(self) -> list[list[float]]:
        """The full symmetric matrix, in the order of ``parameters``."""
        names = self.parameters
        return [[self.covariance(row, column) for column in names] for row in names]

    @property
    def excited(self) -> dict[Parameter, bool]:
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
    def suspected_alternatives(self) -> list[Effect]:
        """Other effects that these data hardly distinguish from the suspected one."""
        bits = self.raw.suspected_alternatives
        return [effect for effect in Effect if bits >> effect & 1]

    @property
    def suspicion_age_s(self) -> int:
        """How long the suspicion has stood, in s."""
        return self.raw.suspicion_age_s

    @property
    def rejected(self) -> dict[RejectionReason, int]:
        """Samples refused, by reason; reasons that never occurred are left out."""
        counts = enumerate(self.raw.rejected_by_reason)
        return {RejectionReason(number): count for number, count in counts if count}

    def resistance_at(self, speed_mps: float, mass_kg: float = 0.0) -> Resistance | None:
        """Basic resistance at a speed, in N for a train of ``mass_kg``.

        ``None`` unless the pipeline estimates all three Davis coefficients.
        """
        found = self.raw.resistance_at(speed_mps, mass_kg)
        return None if found is None else Resistance(*found)


def _with_interval(value: float, std: float, unit: str) -> str:
    """A value with its 95 % interval, to two digits of the interval."""
    half = 1.96 * std
    is_known = math.isfinite(half) and half > 0.0
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 7) if is_known else 3
    return f"{value:.{decimals}f} ± {half:.{decimals}f} {unit}".rstrip()


_Self = TypeVar("_Self", bound="_End")


class _End:
    """One end of a channel; close it, or use it in a ``with`` statement.

    An end that is dropped is closed. One that another thread drops is closed when its own thread
    opens the next end, or ends.
    """

    _end: _native.Publisher | _native.Reader

    def close(self) -> None:
        """Closes the end; a closed one stays closed."""
        self._end.close()

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class SamplePublisher(_End):
    """Publishes one train's samples; a second one for the same train is refused."""

    _end: _native.Publisher

    def __init__(self, train_id: int, root: PathLike | None = None) -> None:
        """Opens the end for a train; the daemon need not run yet.

        ``root`` is the run-time directory; ``None`` takes it from the variable ``DYNOCAR_ROOT``,
        else ``/tmp/dynocar-<user id>``. Raises ``ChannelError`` with the reason in words.
        """
        self._end = _native.Publisher(train_id, root)

    def start_run(self) -> None:
        """Starts a new run (trip): filters do not integrate across."""
        self._end.start_run()

    def publish(
        self,
        *,
        time_ns: int | None = None,
        direction: int = 1,
        wheel_slide: bool = False,
        position_m: float | None = None,
        speed_mps: float | None = None,
        traction_force_n: float | None = None,
        brake_force_n: float | None = None,
        brake_cylinder_pressure_pa: float | None = None,
        acceleration_mps2: float | None = None,
        specific_force_mps2: float | None = None,
        mass_kg: float | None = None,
        ambient_temperature_degc: float | None = None,
        gradient_permille: float | None = None,
        curve_radius_m: float | None = None,
    ) -> int:
        """Publishes a sample and gives its sequence number; ``None`` is a missing value.

        ``time_ns`` is when the values were measured, on the controller's monotonic clock; without
        it, the time of the call. Forces are those of the whole train at the wheel rim, never
        negative.
        """
        values = (
            position_m,
            speed_mps,
            traction_force_n,
            brake_force_n,
            brake_cylinder_pressure_pa,
            acceleration_mps2,
            specific_force_mps2,
            mass_kg,
            ambient_temperature_degc,
            gradient_permille,
            curve_radius_m,
        )
        return self._end.publish(time_ns, direction, int(wheel_slide), values)

    def flush(self, patience_s: float = 0.2) -> int:
        """Waits until every pipeline has taken every sample; gives the number not taken.

        ``close`` waits up to 0.2 s unless this has waited since the last sample. Not for the
        control cycle.
        """
        return self._end.flush(patience_s)


class SnapshotReader(_End):
    """Reads the newest snapshot of each pipeline of one train."""

    _end: _native.Reader

    def __init__(self, train_id: int, root: PathLike | None = None) -> None:
        """Opens the end for a train, as ``SamplePublisher`` does."""
        self._end = _native.Reader(train_id, root)

    def set_stale_after_ns(self, stale_after_ns: int) -> None:
        """Sets the age from which a snapshot counts as stale; 250 ms at first."""
        self._end.set_stale_after_ns(stale_after_ns)

    def poll(self) -> int:
        """Takes what has come since; gives the number of snapshots that brought something new."""
        return self._end.poll()

    def quantity(self, quantity: Quantity, now_ns: int | None = None) -> Snapshot:
        """The newest polled snapshot of the pipeline that answers a quantity.

        Which one that is says the daemon's configuration. Gives a snapshot that is not usable, with
        its ``code``, when none has come yet or no pipeline answers. ``now_ns`` as in ``latest``.
        """
        return Snapshot(self._end.quantity(quantity, now_ns))

    def resistance(self, now_ns: int | None = None) -> Snapshot:
        """``quantity`` for resistance: see ``resistance_at``."""
        return self.quantity(Quantity.RESISTANCE, now_ns)

    def mass(self, now_ns: int | None = None) -> Snapshot:
        """``quantity`` for the gross mass: ``Parameter.MASS`` in t."""
        return self.quantity(Quantity.MASS, now_ns)

    def adhesion(self, now_ns: int | None = None) -> Snapshot:
        """``quantity`` for adhesion: ``Parameter.ADHESION`` or ``ADHESION_LOWER_BOUND``."""
        return self.quantity(Quantity.ADHESION, now_ns)

    def brake_friction(self, now_ns: int | None = None) -> Snapshot:
        """``quantity`` for ``Parameter.DISC_FRICTION``, the declared braking ratio held."""
        return self.quantity(Quantity.BRAKE_FRICTION, now_ns)

    def braking_ratio(self, now_ns: int | None = None) -> Snapshot:
        """``quantity`` for ``Parameter.BRAKING_RATIO``, the declared friction held."""
        return self.quantity(Quantity.BRAKING_RATIO, now_ns)

    def latest(self, kind: PipelineKind, now_ns: int | None = None) -> Snapshot | None:
        """The newest polled snapshot of the first pipeline of a kind, ``None`` before the first.

        ``now_ns`` is the host's monotonic clock; without it, the time of the call.
        """
        return Snapshot(self._end.latest(kind, now_ns))._or_none()

    def latest_by_index(self, index: int, now_ns: int | None = None) -> Snapshot | None:
        """The same, by the pipeline's number in the daemon's configuration."""
        return Snapshot(self._end.latest_by_index(index, now_ns))._or_none()

    @property
    def refused(self) -> int:
        """Messages that no sane daemon would send: foreign train, NaN and the like."""
        return self._end.refused()


def daemon_state(train_id: int, root: PathLike | None = None) -> tuple[DaemonState, str]:
    """Who serves a train, as a state and in words."""
    state, words = _native.daemon_state(train_id, root)
    return DaemonState(state), words


def monotonic_now_ns() -> int:
    """The host's monotonic clock in ns since boot, common to all its processes."""
    return _native.monotonic_now_ns()


def version() -> str:
    """The release."""
    return _native.version()
