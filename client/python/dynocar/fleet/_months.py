"""What changed in a train since the month before."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ._estimates import NORMAL_95, Answer, Found, effects, estimates, is_same
from ._statistics import discoveries, normal_tail


def changes(now: Mapping[str, Answer], before: Mapping[str, Answer]) -> list[dict[str, Any]]:
    """Estimates of the month less those of the month before, for trains that have both, with false
    discoveries kept below 5 % over all of them."""
    changes: list[dict[str, Any]] = []
    for train in sorted(now.keys() & before.keys()):
        old, new = estimates(before[train]), estimates(now[train])
        for parameter in (name for name in new if name in old):
            change = new[parameter].value - old[parameter].value
            std = math.hypot(new[parameter].std, old[parameter].std)
            changes.append(
                {
                    "train": train,
                    "parameter": parameter,
                    "before": old[parameter]._asdict(),
                    "now": new[parameter]._asdict(),
                    "change": change,
                    "interval_95": [change - NORMAL_95 * std, change + NORMAL_95 * std],
                    "z": change / std,
                    "p_value": 2 * normal_tail(abs(change) / std),
                }
            )
    is_found = discoveries([it["p_value"] for it in changes], 0.05)
    return [it | {"is_found": found} for it, found in zip(changes, is_found)]


def effects_changed(
    now: Mapping[str, Answer], before: Mapping[str, Answer]
) -> list[dict[str, Any]]:
    """Effects that came, went and stayed."""
    changes: list[dict[str, Any]] = []
    for train in sorted(now.keys() & before.keys()):
        old, new = effects(before[train]), effects(now[train])
        for found in new:
            stayed = any(is_same(found, other) for other in old)
            changes.append(_change(found, "stayed" if stayed else "came"))
        gone = [other for other in old if not any(is_same(found, other) for found in new)]
        changes += [_change(found, "went") for found in gone]
    return changes


def _change(found: Found, what: str) -> dict[str, Any]:
    return {
        "train": found.train,
        "what": what,
        "kind": found.kind,
        "interval_m": list(found.interval_m) if found.interval_m else None,
        "parameters": {name: estimate._asdict() for name, estimate in found.parameters.items()},
    }
