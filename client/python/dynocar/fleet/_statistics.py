"""Pooling of estimates, and judging which of them differ from the others.

Nothing here knows of trains; what it promises (coverage, false discoveries) is held over seeded
simulations by ``tests/test_fleet_statistics.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Fewer others say nothing of their scatter.
LEAST_OTHERS = 3
# The first look takes those for far that are so many standard deviations from the median, of so many: of sets
# of 12 normal numbers 1 % have one.
FAR, LEAST_FOR_FAR = 6.0, 8


class Estimate(NamedTuple):
    """A number with its standard deviation."""

    value: float
    std: float


class Pooled(NamedTuple):
    """The mean of estimates of things that may truly differ."""

    mean: float
    std: float  # of the mean
    low: float  # 95 % interval of the mean
    high: float
    std_between: float  # of the true values
    estimates: int


class Difference(NamedTuple):
    """An estimate against those of the others."""

    name: str
    parameter: str
    own: Estimate
    others: Pooled
    z: float
    p_value: float
    is_found: bool


class _Means(NamedTuple):
    """Pooled means, one for each row."""

    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    between: NDArray[np.float64]  # variance of the true values
    between_std: NDArray[np.float64]  # of that variance


def pool(estimates: Sequence[Estimate]) -> Pooled:
    """The mean under random effects: own standard deviations and a scatter between the true values.

    The scatter by restricted maximum likelihood (Viechtbauer 2005, J. Educ. Behav. Stat. 30, 261,
    eq. 10), the interval of the mean by Knapp and Hartung (2003, Stat. Med. 22, 2693, eq. 8) with
    Student's quantile of one degree less than there are estimates, and never narrower than the
    estimates state it (Röver et al. 2015, BMC Med. Res. Methodol. 15, 99). A single estimate is its
    own mean, with its own interval.
    """
    if len(estimates) == 1:
        own, reach = estimates[0], 1.959963984540054 * estimates[0].std
        return Pooled(own.value, own.std, own.value - reach, own.value + reach, 0.0, 1)
    values, stds = np.array(estimates).T
    means = _means(values, stds**2, np.ones((1, len(values))))
    mean, std = float(means.mean[0]), float(means.std[0])
    reach = student_quantile(0.975, len(values) - 1) * std
    between = math.sqrt(float(means.between[0]))
    return Pooled(mean, std, mean - reach, mean + reach, between, len(values))


def _means(
    values: NDArray[np.float64], variances: NDArray[np.float64], counts: NDArray[np.float64]
) -> _Means:
    """The pooled mean for each row of `counts`: 1 for an estimate that takes part, 0 for another."""
    between = _restricted_scatter(values, variances, counts)
    weights = counts / (variances + between[:, None])
    total = weights.sum(axis=1)
    mean = weights @ values / total
    squares = (weights * (values - mean[:, None]) ** 2).sum(axis=1)
    std = np.sqrt(np.maximum(1.0, squares / (counts.sum(axis=1) - 1)) / total)
    # The information about the scatter: eq. 12 of Viechtbauer.
    second, third = (weights**2).sum(axis=1), (weights**3).sum(axis=1)
    information = (second - 2 * third / total + (second / total) ** 2) / 2
    return _Means(mean, std, between, 1 / np.sqrt(information))


def _restricted_scatter(
    values: NDArray[np.float64], variances: NDArray[np.float64], counts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where the slope of the restricted likelihood over the variance between the true values is 0."""

    def is_rising(between: NDArray[np.float64]) -> NDArray[np.bool_]:
        weights = counts / (variances + between[:, None])
        total = weights.sum(axis=1)
        mean = weights @ values / total
        second = (weights**2).sum(axis=1)
        fit = (weights**2 * (values - mean[:, None]) ** 2).sum(axis=1)
        return np.asarray(fit - total + second / total > 0)

    low = np.zeros(len(counts))
    high = np.full(len(counts), float(np.ptp(values)) ** 2 + float(variances.max()))
    is_scattered = is_rising(low)
    while np.any(is_rising(high)):
        high *= 2
    for _ in range(60):
        middle = (low + high) / 2
        rising = is_rising(middle)
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return np.where(is_scattered, (low + high) / 2, 0.0)


def differing(
    estimates: Mapping[str, Mapping[str, Estimate]], rate: float = 0.05
) -> list[Difference]:
    """Which things differ from the others, for each parameter a mapping from name to estimate.

    Each estimate is held against the pooled mean of the others: the difference over its standard deviation,
    of its own variance, the scatter between the others and the variance of their mean. Few others
    say little of their scatter: one standard deviation of its estimate is added to it, and the
    degrees of freedom are Satterthwaite's (1946, Biometrics 2, 110). False discoveries are kept
    below the rate over all at once (`discoveries`).

    So that one does not hide another, those far from the median do not count among the others at
    first; who is not found to differ then does again. After that the farthest one that is found
    for a parameter ceases to count there, until none is found anew.
    """
    out = {parameter: _far(of_names) for parameter, of_names in estimates.items()}
    first = _judged(estimates, out, rate)
    found = {(it.parameter, it.name) for it in first if it.is_found}
    out = {of: {name for name in names if (of, name) in found} for of, names in out.items()}
    while True:
        judged = _judged(estimates, out, rate)
        further: dict[str, Difference] = {}
        for difference in sorted(judged, key=lambda it: abs(it.z)):
            if difference.is_found and difference.name not in out[difference.parameter]:
                further[difference.parameter] = difference
        if not further:
            return judged
        for parameter, difference in further.items():
            out[parameter].add(difference.name)


def _far(of_names: Mapping[str, Estimate]) -> set[str]:
    """Those farther from the median than `FAR` times their own standard deviation and the one that the median
    absolute deviation of all decide (Hampel's identifier); of few these say nothing."""
    if len(of_names) < LEAST_FOR_FAR:
        return set()
    middle = median(estimate.value for estimate in of_names.values())
    scale = 1.4826 * median(abs(estimate.value - middle) for estimate in of_names.values())
    return {
        name
        for name, estimate in of_names.items()
        if abs(estimate.value - middle) > FAR * max(scale, estimate.std)
    }


def _judged(
    estimates: Mapping[str, Mapping[str, Estimate]], out: Mapping[str, set[str]], rate: float
) -> list[Difference]:
    """Each estimate against the others but those that are out, and which are discoveries."""
    judged = [it for of in estimates for it in _beside_others(of, estimates[of], out[of])]
    is_found = discoveries([difference.p_value for difference in judged], rate)
    return [difference._replace(is_found=found) for difference, found in zip(judged, is_found)]


def _beside_others(
    parameter: str, of_names: Mapping[str, Estimate], out: set[str]
) -> list[Difference]:
    """Each estimate against the others that count, where these are enough."""
    names = list(of_names)
    values, stds = np.array(list(of_names.values())).reshape(-1, 2).T
    counts = np.tile([float(name not in out) for name in names], (len(names), 1))
    np.fill_diagonal(counts, 0.0)
    is_enough = counts.sum(axis=1) >= LEAST_OTHERS
    if not is_enough.any():
        return []
    names = [name for name, enough in zip(names, is_enough) if enough]
    counts = counts[is_enough]
    others = counts.sum(axis=1)
    means = _means(values, stds**2, counts)
    values, stds = values[is_enough], stds[is_enough]
    scatter = means.between + means.between_std
    uncertain = scatter + means.std**2
    variance = stds**2 + uncertain
    z = (values - means.mean) / np.sqrt(variance)
    # Others that happen to lie close together would make themselves seem known: so much, no more.
    freedom = (others - 1) * np.minimum((variance / uncertain) ** 2, 3.0)
    judged = []
    for k, name in enumerate(names):
        mean, std = float(means.mean[k]), float(means.std[k])
        reach = student_quantile(0.975, others[k] - 1) * std
        between = math.sqrt(float(means.between[k]))
        pooled = Pooled(mean, std, mean - reach, mean + reach, between, int(others[k]))
        p_value = 2 * student_tail(abs(float(z[k])), float(freedom[k]))
        judged.append(
            Difference(name, parameter, of_names[name], pooled, float(z[k]), p_value, False)
        )
    return judged


def discoveries(p_values: Sequence[float], rate: float) -> list[bool]:
    """Which of the tests are discoveries, so that in the mean no more than a share `rate` is false.

    However the tests depend on each other, as those that share their others do (Benjamini and
    Yekutieli 2001, Ann. Stat. 29, 1165, theorem 1.3).
    """
    count = len(p_values)
    allowed = rate / (count * sum(1 / k for k in range(1, count + 1))) if count else 0.0
    passed = [p for k, p in enumerate(sorted(p_values), 1) if p <= k * allowed]
    return [p <= passed[-1] if passed else False for p in p_values]


def normal_tail(z: float) -> float:
    """Chance that a standard normal number exceeds z."""
    return math.erfc(z / math.sqrt(2)) / 2


def student_tail(t: float, freedom: float) -> float:
    """Chance that Student's t exceeds t >= 0: half the regularised incomplete beta function of
    freedom / 2, 1 / 2 at freedom / (freedom + t^2) (Abramowitz and Stegun 26.7.1)."""
    return _incomplete_beta(freedom / 2, 0.5, freedom / (freedom + t * t)) / 2


@lru_cache(maxsize=1024)
def student_quantile(share: float, freedom: float) -> float:
    """The t below which Student's t lies with a chance of `share` > 0.5."""
    low, high = 0.0, 1.0
    while student_tail(high, freedom) > 1 - share:
        high *= 2
    for _ in range(80):
        middle = (low + high) / 2
        is_below = student_tail(middle, freedom) > 1 - share
        low, high = (middle, high) if is_below else (low, middle)
    return (low + high) / 2


def _incomplete_beta(a: float, b: float, x: float) -> float:
    """I_x(a, b) by its continued fraction (Abramowitz and Stegun 26.5.8), from the side where it
    converges fast."""
    if x <= 0 or x >= 1:
        return 0.0 if x <= 0 else 1.0
    if x > (a + 1) / (a + b + 2):
        return 1 - _incomplete_beta(b, a, 1 - x)
    fraction, d, c = 1.0, 0.0, 1.0
    for step in range(400):
        m = step // 2
        if step == 0:
            term = 1.0
        elif step % 2 == 0:
            term = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        else:
            term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        d = 1 / (1 + term * d)
        c = 1 + term / c
        fraction *= c * d
        if abs(1 - c * d) < 1e-15:
            break
    log_beta = math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    front = math.exp(a * math.log(x) + b * math.log1p(-x) - log_beta) / a
    return front * (fraction - 1)
