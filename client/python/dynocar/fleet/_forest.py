"""Estimates under each other with their intervals, as SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from ._estimates import NORMAL_95

WIDTH, LEFT, RIGHT, ROW, TOP = 480, 120, 20, 20, 6


class Row(NamedTuple):
    """A train with its estimate; `is_out` draws it in the colour of what stands out."""

    name: str
    value: float
    std: float
    is_out: bool


def forest(rows: Sequence[Row], band: tuple[float, float] | None, null: float) -> str:
    """Each row's value with its 95 % interval, the pooled interval as a band, no effect as a line."""
    ends = [row.value + side * NORMAL_95 * row.std for row in rows for side in (-1, 1)]
    ends += [*(band or ()), null]
    low, high = min(ends), max(ends)
    room = 0.05 * (high - low) or 1.0
    low, high = low - room, high + room
    height = TOP + ROW * len(rows) + 24

    def x(value: float) -> float:
        return LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    parts = []
    if band is not None:
        width = max(1.0, x(band[1]) - x(band[0]))
        deep = ROW * len(rows)
        parts.append(_tag("rect", "band", x=x(band[0]), y=TOP, width=width, height=deep))
    parts.append(_line("null", x(null), TOP, x(null), TOP + ROW * len(rows)))
    for k, row in enumerate(rows):
        middle, kind = TOP + ROW * (k + 0.5), "out" if row.is_out else "own"
        reach = NORMAL_95 * row.std
        parts.append(f'<text x="0" y="{middle + 4:.1f}">{escape(shortened(row.name))}</text>')
        parts.append(_line(kind, x(row.value - reach), middle, x(row.value + reach), middle))
        parts.append(_tag("circle", kind, cx=x(row.value), cy=middle, r=3))
    for value in _ticks(low, high):
        text = f'<text class="tick" text-anchor="middle" x="{x(value):.1f}" y="{height - 6}">'
        shown = f"{value:.6g}".replace("-", "−")
        parts.append(f"{text}{shown}</text>")
    words = f"{len(rows)} estimates with their 95 % intervals"
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{words}">'
        f"{''.join(parts)}</svg>"
    )


def _ticks(low: float, high: float) -> list[float]:
    """Three to seven round values between two."""
    power = 10.0 ** math.floor(math.log10(high - low))
    for share in (5.0, 2.0, 1.0, 0.5, 0.2):
        step = share * power
        ticks = [step * k for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
        if len(ticks) >= 3:
            break
    return ticks


def shortened(name: str) -> str:
    return name if len(name) <= 16 else f"{name[:15]}…"


def _tag(name: str, kind: str, **numbers: float) -> str:
    attributes = " ".join(f'{key}="{number:.1f}"' for key, number in numbers.items())
    return f'<{name} class="{kind}" {attributes}/>'


def _line(kind: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return _tag("line", kind, x1=x1, y1=y1, x2=x2, y2=y2)
