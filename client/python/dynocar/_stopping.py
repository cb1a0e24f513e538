"""Braking distance and time with a bound, by the law that Rust and C have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

from . import _native
from ._vocabulary import Rail


@dataclass(frozen=True)
class StoppingEstimate:
    """Distance in m and time in s of a stop, and what both do not exceed with the confidence."""

    distance_m: float
    time_s: float
    distance_bound_m: float
    time_bound_s: float


@dataclass(frozen=True)
class Stop:
    """The stop that is asked about: the fields of ``dynocar_stop`` in ``dynocar.h``, which gives their meaning."""

    from_speed_mps: float
    mass_kg: float
    to_speed_mps: float = 0.0
    rotating_mass_factor: float = 0.0
    gradient_permille: float = 0.0
    davis_a: float = 0.0
    davis_b: float = 0.0
    davis_c: float = 0.0
    w0_std_n_per_kn: float = 0.0
    brake_scale: float = 1.0
    brake_scale_std: float = 0.0
    traction_cut_off_s: float = 0.0
    dead_time_s: float = 0.0
    build_up_s: float = 0.0
    jerk_limit_mps3: float = 0.0
    response_std_s: float = 0.0
    adhesion: float = 0.0
    adhesion_std: float = 0.0
    rail: Rail = Rail.UNLIMITED

    def estimate(self, brake_effort: Sequence[tuple[float, float]], confidence: float) -> StoppingEstimate:
        """Distance and time; ``brake_effort`` are speeds in m/s and brake forces of the train in N.

        Raises ``ChannelError`` with ``Code.BAD_NUMBER`` or ``Code.DOES_NOT_STOP``.
        """
        first, mass_kg, second, *others, rail = astuple(self)
        numbers = [first, second, mass_kg, *others]
        return StoppingEstimate(*_native.stopping_estimate(numbers, rail, list(brake_effort), confidence))
