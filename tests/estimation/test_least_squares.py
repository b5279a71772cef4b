"""Least squares against linear regression, whose answers are known, and what it says of bounds and colour."""

import math

import numpy as np
import pytest
from scipy.stats import t as student

from delaytools.estimation.least_squares import effective_number, estimate
from delaytools.signals.parameter import Parameter
from delaytools.signals.trouble import DelaytoolsError

X = np.linspace(0, 1, 200)
BASIS = np.stack([np.ones_like(X), X], axis=1)


def line(seed: int = 1) -> np.ndarray:
    return BASIS @ np.array([2.0, -3e4]) + 5.0 * np.random.default_rng(seed).standard_normal(len(X))


def start(**marks: float) -> list[Parameter]:
    return [Parameter("level", 1.0), Parameter("slope", -1e3, **marks)]


@pytest.mark.parametrize("exact", [True, False])
def test_is_linear_regression(exact: bool) -> None:
    y = line()
    found = estimate(lambda x: BASIS @ x - y, start(), jacobian=(lambda x: BASIS) if exact else None, coloured=False)
    best, squares = np.linalg.lstsq(BASIS, y, rcond=None)[:2]
    covariance = squares[0] / 198 * np.linalg.inv(BASIS.T @ BASIS)
    assert [p.value for p in found.parameters] == pytest.approx(best, rel=1e-6)
    assert [p.std for p in found.parameters] == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-5)
    correlation = covariance[0, 1] / math.sqrt(np.prod(np.diag(covariance)))
    assert found.correlation[0, 1] == pytest.approx(correlation, rel=1e-5)
    reach = student.ppf(0.975, 198) * found["slope"].std
    assert found.limits("slope") == pytest.approx((best[1] - reach, best[1] + reach))
    assert found.success and not found.at_boundary


def test_a_bound_is_said() -> None:
    y = line()
    found = estimate(lambda x: BASIS @ x - y, start(low=-2e4, high=0.0))
    assert found.at_boundary == ("slope",)
    assert found["slope"].value == pytest.approx(-2e4, rel=1e-6)
    assert math.isnan(found["slope"].std) and found["level"].std > 0
    assert "on a bound: slope" in found.words


def test_a_fixed_value_stays() -> None:
    y = line()
    fixed = [Parameter("level", 1.0), Parameter("slope", -2e4, fixed=True)]
    found = estimate(lambda x: BASIS @ x - y, fixed)
    assert found["slope"].value == -2e4
    assert found["level"].value == pytest.approx(float(np.mean(y + 2e4 * X)))


def test_what_the_data_do_not_tell() -> None:
    y = line()
    found = estimate(lambda x: BASIS @ np.array([x[0] + x[1], x[2]]) - y, [*start(), Parameter("other", 1.0)])
    assert math.isinf(found["level"].std) and math.isinf(found["slope"].std)


def test_effective_number_of_coloured_noise() -> None:
    """AR(1) of ρ: n/n_eff = (1 + ρ)/(1 - ρ)."""
    rng = np.random.default_rng(4)
    white = rng.standard_normal(100_000)
    assert effective_number(white) == pytest.approx(100_000, rel=0.02)
    red = np.zeros_like(white)
    for k in range(1, len(white)):
        red[k] = 0.8 * red[k - 1] + white[k]
    assert effective_number(red) == pytest.approx(100_000 * 0.2 / 1.8, rel=0.1)


def test_limits_cover_under_coloured_noise() -> None:
    """A mean under AR(1) noise of ρ = 0.8: white limits would cover half of the time."""
    inside = {True: 0, False: 0}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        noise = np.zeros(2000)
        for k, draw in enumerate(rng.standard_normal(2000)):
            noise[k] = 0.8 * noise[k - 1] + draw
        for coloured in inside:
            found = estimate(lambda x, r=noise: x[0] - r, [Parameter("mean", 0.5)], coloured=coloured)
            low, high = found.limits("mean")
            inside[coloured] += low <= 0 <= high
    assert 88 <= inside[True] <= 100
    assert inside[False] < 70


def test_faults() -> None:
    with pytest.raises(DelaytoolsError, match="too few residuals"):
        estimate(lambda x: x, [Parameter("a", 1.0)])
    with pytest.raises(DelaytoolsError, match="not finite"):
        estimate(lambda x: np.full(5, np.nan), [Parameter("a", 1.0)])
    with pytest.raises(DelaytoolsError, match="not a fitted parameter"):
        estimate(lambda x: x[0] - X, [Parameter("a", 1.0)]).limits("b")


def test_enough_ends_a_search_where_it_stands() -> None:
    runs: list[float] = []

    def left(x: np.ndarray) -> np.ndarray:
        runs.append(float(x[0]))
        return np.exp(-x[0] * X) - np.exp(-40.0 * X)

    found = estimate(left, [Parameter("rate", 1.0)], enough=lambda: len(runs) >= 4)
    assert not found.success and 1.0 < found["rate"].value < 39.0
    whole = estimate(left, [Parameter("rate", 1.0)])
    assert whole.success and whole["rate"].value == pytest.approx(40.0)
    assert np.abs(left(np.array([found["rate"].value]))).max() > 1e-3


def test_a_start_on_its_bound_is_the_same_for_check_and_search() -> None:
    """A start is moved inside its bounds before anything is evaluated, not after."""
    y, seen = line(), []

    def residual(x: np.ndarray) -> np.ndarray:
        seen.append(x.copy())
        return BASIS @ x - y

    found = estimate(residual, start(low=-1e5, high=-1e3), jacobian=lambda x: BASIS, coloured=False)
    assert np.abs(seen[0] - seen[1]).max() == 0 and found["slope"].value == pytest.approx(-3e4, rel=1e-3)
