"""What the fleet's statistics promise, over seeded simulations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from dynocar.fleet._statistics import (
    Estimate,
    differing,
    discoveries,
    normal_tail,
    pool,
    student_quantile,
    student_tail,
)


def test_students_distribution_is_that_of_the_tables() -> None:
    for freedom, quantile in [(1, 12.7062), (2, 4.3027), (5, 2.5706), (10, 2.2281), (30, 2.0423)]:
        assert student_quantile(0.975, freedom) == pytest.approx(quantile, abs=1e-4)
    assert student_tail(2.0, 3) == pytest.approx(0.0696629, abs=1e-7)
    assert student_tail(2.0, 1e6) == pytest.approx(normal_tail(2.0), rel=1e-5)
    assert student_tail(1.0, 1) == pytest.approx(0.25, abs=1e-14)
    assert student_tail(40.0, 4.5) < 1e-5


def test_a_mean_of_equals_is_the_plain_mean_and_its_interval_students() -> None:
    values = [1.0, 2.0, 4.0, 5.0]
    pooled = pool([Estimate(value, 0.1) for value in values])
    assert pooled.mean == pytest.approx(3.0)
    # Equal standard deviations: the scatter is the sample's variance less theirs, the interval is Student's.
    assert pooled.std_between == pytest.approx(math.sqrt(np.var(values, ddof=1) - 0.01))
    assert pooled.std == pytest.approx(np.std(values, ddof=1) / 2)
    assert pooled.high - pooled.mean == pytest.approx(3.1824 * pooled.std, rel=1e-4)


def test_the_scatter_is_that_of_a_published_example() -> None:
    # BCG vaccine, log risk ratios of 13 trials (Colditz 1994); REML as printed by metafor 4.6:
    # tau^2 = 0.3132, mean = -0.7145; with Knapp and Hartung: std = 0.1808, -1.1084 to -0.3206.
    values = [
        -0.8893,
        -1.5854,
        -1.3481,
        -1.4416,
        -0.2175,
        -0.7861,
        -1.6209,
        0.0120,
        -0.4694,
        -1.3713,
        -0.3394,
        0.4459,
        -0.0173,
    ]
    variances = [
        0.3256,
        0.1946,
        0.4154,
        0.0200,
        0.0512,
        0.0069,
        0.2230,
        0.0040,
        0.0564,
        0.0730,
        0.0124,
        0.5325,
        0.0714,
    ]
    pooled = pool([Estimate(y, math.sqrt(v)) for y, v in zip(values, variances)])
    assert pooled.std_between**2 == pytest.approx(0.3132, abs=5e-4)
    assert pooled.mean == pytest.approx(-0.7145, abs=5e-4)
    assert pooled.std == pytest.approx(0.1808, abs=5e-4)
    assert (pooled.low, pooled.high) == pytest.approx((-1.1084, -0.3206), abs=1e-3)


@pytest.mark.parametrize("trains", [3, 6, 15])
def test_the_pooled_interval_holds_the_truth_in_95_of_100_or_more(trains: int) -> None:
    random, held, fleets = np.random.default_rng(7 * trains), 0, 0
    for scatter in (0.0, 0.5, 2.0):
        for _ in range(200):
            stds = random.uniform(0.5, 2.0, trains)
            values = random.normal(0.0, scatter, trains) + random.normal(0.0, stds)
            pooled = pool([Estimate(*it) for it in zip(values, stds)])
            held += pooled.low <= 0 <= pooled.high
            fleets += 1
    # 600 fleets measure a share to 0.9 %.
    assert held / fleets >= 0.94


def test_discoveries_are_those_of_benjamini_and_yekutieli() -> None:
    # Of four the k-th smallest may be up to k * 0.05 / 4 / (1 + 1/2 + 1/3 + 1/4) = k * 0.006.
    assert discoveries([0.2, 0.013, 0.005, 0.017], 0.05) == [False, True, True, True]
    assert discoveries([0.2, 0.013, 0.0061, 0.0185], 0.05) == [False] * 4
    assert discoveries([0.05], 0.05) == [True] and discoveries([], 0.05) == []


def simulated(
    random: np.random.Generator, trains: int, scatter: float, away: int
) -> tuple[dict[str, dict[str, Estimate]], set[tuple[str, str]]]:
    """Four parameters of a fleet; in the first, `away` trains lie 10 standard deviations off."""
    numbers, true = {}, set()
    for parameter in ("a", "b", "c", "mass"):
        stds = random.uniform(0.5, 2.0, trains)
        values = random.normal(0.0, scatter, trains) + random.normal(0.0, stds)
        for k in range(away if parameter == "a" else 0):
            values[k] += 10 * math.hypot(scatter, 1.5)
            true.add((f"train {k}", parameter))
        numbers[parameter] = {f"train {k}": Estimate(*it) for k, it in enumerate(zip(values, stds))}
    return numbers, true


@pytest.mark.parametrize("trains", [5, 12])
@pytest.mark.parametrize("scatter", [0.0, 1.0])
def test_false_discoveries_stay_below_5_of_100_and_true_ones_are_found(
    trains: int, scatter: float
) -> None:
    random = np.random.default_rng(100 * trains + int(scatter))
    for away in (0, 1, trains // 6):
        false, power = [], []
        for _ in range(40):
            numbers, true = simulated(random, trains, scatter, away)
            found = {(it.name, it.parameter) for it in differing(numbers) if it.is_found}
            false.append(len(found - true) / max(1, len(found)))
            power.append(len(found & true) / max(1, len(true)))
        assert np.mean(false) <= 0.05
        assert away == 0 or np.mean(power) > (0.8 if trains > 5 else 0.5)


def test_too_few_others_say_nothing() -> None:
    numbers = {"a": {f"train {k}": Estimate(float(k), 0.1) for k in range(3)}}
    assert differing(numbers) == []


@pytest.mark.parametrize("trains", [5, 8])
def test_trains_that_truly_scatter_are_not_said_to_differ(trains: int) -> None:
    random, false = np.random.default_rng(trains), 0
    for _ in range(150):
        numbers, _ = simulated(random, trains, 3.0, 0)
        false += any(it.is_found for it in differing(numbers))
    # 150 fleets measure a share of 5 in 100 to 1.8.
    assert false / 150 <= 0.05 + 0.018
