"""Effects over trains: what several find is the line's or the fleet's, what one finds is its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

from ._estimates import NO_EFFECT, NORMAL_95, SAME_PLACE, UNITS, Answer, Found, effects, is_same
from ._statistics import Estimate, Pooled, pool
from ._work import ASKABLE, Declared

# Of an effect that a single train finds, so many others are asked.
ASKED_OF_ONE = 5


class Common(NamedTuple):
    """Effects of several trains that may be one."""

    name: str
    kind: str  # the one most trains name
    line: str | None
    interval_m: tuple[float, float] | None
    found: list[Found]

    @property
    def parameter(self) -> str | None:
        """The number that is pooled."""
        names = [name for it in self.found if it.kind == self.kind for name in it.parameters]
        return next((name for name in names if name != "dc_n_per_mps2"), None)

    def declared(self, answer: Answer) -> Declared | None:
        """What a train that did not find it can be asked about; nothing where it cannot be asked."""
        own = self.estimates()
        if (
            self.kind not in ASKABLE
            or not own
            or (self.kind == ASKABLE[0]) != bool(self.interval_m)
        ):
            return None
        beside = [
            (*it.interval_m, it.parameters["extra_n_per_kn"].value)
            for it in effects(answer)
            if it.kind == self.kind and it.interval_m and self.is_clear_of(it.interval_m)
        ]
        value = pool(list(own.values())).mean
        return Declared(self.name, self.kind, value, self.interval_m, tuple(beside))

    def is_clear_of(self, interval_m: tuple[float, float]) -> bool:
        """Whether a stretch lies elsewhere: what is declared of a line must not overlap."""
        start, end = self.interval_m or (0.0, 0.0)
        return interval_m[1] <= start or interval_m[0] >= end

    def estimates(self) -> dict[str, Estimate]:
        """The number of each train that names the kind."""
        name = self.parameter
        return {
            it.train: it.parameters[name]
            for it in self.found
            if name is not None and it.kind == self.kind and name in it.parameters
        }

    def asked(self, answers: Mapping[str, Answer]) -> list[str]:
        """Trains that did not find it, of those that run where it is."""
        have = {it.train for it in self.found}
        others = [
            train
            for train, answer in answers.items()
            if train not in have and (not self.interval_m or answer.get("line") == self.line)
        ]
        return others if len(have) > 1 else others[:ASKED_OF_ONE]


def group(answers: Mapping[str, Answer]) -> list[Common]:
    """Effects of all trains' answers, those together that may be one; the most frequent first."""
    groups: list[list[Found]] = []
    for train in sorted(answers):
        for found in effects(answers[train]):
            own = [it for it in groups if any(is_same(found, other) for other in it)]
            groups = [it for it in groups if it not in own]
            groups.append([found, *(other for it in own for other in it)])
    commons = [_common(sorted(found, key=lambda it: it.train)) for found in groups]
    return sorted(commons, key=lambda it: (-len({found.train for found in it.found}), it.name))


def _common(found: list[Found]) -> Common:
    kind = Counter(it.kind for it in found).most_common(1)[0][0]
    placed = [it.interval_m for it in found if it.interval_m is not None]
    if not placed:
        name = f"unknown of {found[0].train}" if kind == "unknown" else kind
        return Common(name, kind, found[0].line, None, found)
    start, end = median(it[0] for it in placed), median(it[1] for it in placed)
    return Common(f"{kind}@{start:.0f}-{end:.0f}", kind, found[0].line, (start, end), found)


def common_effects(
    commons: Sequence[Common],
    answers: Mapping[str, Answer],
    asked: Mapping[tuple[str, str], Answer],
) -> list[dict[str, Any]]:
    """What is said of each: whose it is, the pooled number, and each train's part in it.

    ``asked`` holds the answers of trains to which an effect was declared, by train and effect.
    """
    return [_common_effect(common, answers, asked) for common in commons]


def _common_effect(
    common: Common, answers: Mapping[str, Answer], asked: Mapping[tuple[str, str], Answer]
) -> dict[str, Any]:
    own = common.estimates()
    states = {it.train: "found" for it in common.found}
    for train, answer in answers.items():
        if train not in states and (not common.interval_m or answer.get("line") == common.line):
            states[train], estimate = _asked(common, asked.get((train, common.name)))
            if estimate is not None:
                own[train] = estimate
    pooled = [own[train] for train, state in states.items() if state == "found" and train in own]
    counts = Counter(states.values())
    parameter = common.parameter
    return {
        "name": common.name,
        "kind": common.kind,
        "kinds": dict(Counter(it.kind for it in common.found)),
        "line": common.line if common.interval_m else None,
        "interval_m": list(common.interval_m) if common.interval_m else None,
        "ends_m": _ends(common.found),
        "belongs_to": _owner(counts, is_place=common.interval_m is not None),
        "parameter": parameter,
        "unit": UNITS.get(parameter or "", ""),
        "no_effect": NO_EFFECT.get(parameter or "", 0.0),
        "pooled": pool(pooled)._asdict() if pooled else None,
        "trains": [
            {
                "train": train,
                "state": state,
                "value": own[train].value if train in own else None,
                "std": own[train].std if train in own else None,
            }
            for train, state in sorted(states.items())
        ],
    }


def _asked(common: Common, answer: Answer | None) -> tuple[str, Estimate | None]:
    """What a train says to which the effect was declared.

    Where it then finds the opposite, its data could have shown the effect, and what is left of it
    is the train's own number. Where it finds nothing, with the effect declared or without, its data
    do not determine it.
    """
    if answer is None:
        return "not_asked", None
    if "error" in answer:
        return "failed", None
    declared, found = (
        answer["declared"],
        [it for it in effects(answer | {"line": common.line}) if it.kind == common.kind],
    )
    estimate = _left(found, common, declared["value"])
    if estimate is None:
        return "cannot_tell", None
    away = abs(estimate.value - NO_EFFECT.get(common.parameter or "", 0.0))
    return ("absent" if away <= NORMAL_95 * estimate.std else "found"), estimate


def _left(found: Sequence[Found], common: Common, declared: float) -> Estimate | None:
    """What is left of a declared effect after what was found jointly with it.

    Of a place it is the resistance there less that around it, as far as the place is long: that a
    place has less and that all the rest has more are the same, but for a, which is fitted, too.
    """
    name = common.parameter
    of_name = [it for it in found if name is not None and name in it.parameters]
    if not of_name or name is None:
        return None
    value, std = of_name[0].parameters[name]
    if common.interval_m is None:
        return Estimate(declared * value, declared * std)
    (start, end), length = common.interval_m, common.interval_m[1] - common.interval_m[0]

    def share(low: float, high: float) -> float:
        """Of a stretch, what the places found cover."""
        at = [it.interval_m for it in of_name if it.interval_m is not None]
        return sum(max(0.0, min(high, b) - max(low, a)) for a, b in at) / (high - low)

    around = (share(start - length, start) + share(end, end + length)) / 2
    net = share(start, end) - around
    if abs(net) < SAME_PLACE:
        return None
    return Estimate(declared + net * value, std)


def _ends(found: Sequence[Found]) -> list[dict[str, float]] | None:
    """The pooled ends of a place."""
    known = [(it.interval_m, it.ends_std_m) for it in found if it.interval_m and it.ends_std_m]
    if not known:
        return None

    def end(side: int) -> Pooled:
        return pool([Estimate(interval[side], stds[side]) for interval, stds in known])

    return [end(0)._asdict(), end(1)._asdict()]


def _owner(counts: Counter[str], is_place: bool) -> str:
    if counts["found"] == 1:
        return "train" if counts["absent"] else "undecided"
    if counts["absent"]:
        return "some_trains"
    return "line" if is_place else "fleet"
