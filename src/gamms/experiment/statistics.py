"""Statistics of games: intervals, paired comparisons and Sobol indices. The only file that loads SciPy here.

Games of one seed are correlated, so the functions take one value for each seed: the mean over its games.
Random draws are seeded: the same rows give the same numbers.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import NormalDist, fmean
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.plugins import require_extra

_RESAMPLES = 2_000
_PERMUTATIONS = 9_999
LEAST_P = 2.0 / (_PERMUTATIONS + 1)  # smallest p of a test with random signs; the true p may be smaller
FEW_SEEDS = 100  # up to so many seeds, bootstrap intervals of means may be too narrow
_MOST_OF_BCA = 1_000  # values; the method needs memory for the square of their number
_SEED = 20
_CELLS = 1 << 22  # elements of an array of resamples


class Interval(NamedTuple):
    """An estimate with its confidence interval."""

    value: float
    low: float
    high: float


class PairedComparison(NamedTuple):
    """A comparison of pairs.

    Attributes:
        difference: the mean of the differences.
        low: the lower end of its interval.
        high: the upper end of its interval.
        effect: Cohen's d_z, the mean of the differences divided by their standard deviation.
        p: the probability of a mean at least as far from 0 if the signs of the differences were random.
    """

    difference: float
    low: float
    high: float
    effect: float
    p: float


def estimate_mean(values: Sequence[float] | FloatArray, confidence: float = 0.95) -> Interval:
    """Return the mean and its BCa bootstrap interval; for more than 1,000 values, the percentile interval.

    Equal values say nothing about their spread, so the ends of their interval are NaN. Intervals of
    up to `FEW_SEEDS` values may be too narrow.

    Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapters 13 and 14.

    Raises:
        MissingExtra: SciPy is not installed.
    """
    given = np.asarray(values, float)
    stats = _import_stats()
    if not len(given):
        return Interval(np.nan, np.nan, np.nan)
    mean = float(given.mean())
    if np.ptp(given) == 0.0:
        return Interval(mean, np.nan, np.nan)
    found = stats.bootstrap(
        (given,),
        np.mean,
        n_resamples=_RESAMPLES,
        batch=max(1, _CELLS // len(given)),
        confidence_level=confidence,
        method="BCa" if len(given) <= _MOST_OF_BCA else "percentile",
        random_state=np.random.default_rng(_SEED),
    ).confidence_interval
    return Interval(mean, float(found.low), float(found.high))


def compute_t_interval(values: Sequence[float] | FloatArray, confidence: float = 0.95) -> tuple[float, float]:
    """Return the ends of Student's interval of the mean (Biometrika 6, 1908); NaN for equal values, or fewer than two.

    It assumes that the values are roughly normal, and then covers the mean as often as it says, also for few values.

    Raises:
        MissingExtra: SciPy is not installed.
    """
    given = np.asarray(values, float)
    stats = _import_stats()
    if len(given) < 2 or np.ptp(given) == 0.0:
        return np.nan, np.nan
    half = float(stats.t.ppf((1.0 + confidence) / 2.0, len(given) - 1) * stats.sem(given))
    mean = float(given.mean())
    return mean - half, mean + half


def estimate_rate(successes: float, trials: float, confidence: float = 0.95) -> Interval:
    """Return a rate and its score interval (Wilson, JASA 22, 1927); neither number has to be an integer."""
    if not trials:
        return Interval(np.nan, np.nan, np.nan)
    rate = successes / trials
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    shrinkage = 1.0 + z * z / trials
    center = (rate + z * z / (2.0 * trials)) / shrinkage
    half = z / shrinkage * math.sqrt(rate * (1.0 - rate) / trials + z * z / (4.0 * trials * trials))
    low = 0.0 if rate == 0.0 else center - half
    high = 1.0 if rate == 1.0 else center + half
    return Interval(rate, low, high)


def estimate_rate_of_seeds(rates: Sequence[float], games: int, confidence: float = 0.95) -> Interval:
    """Return the mean of the rates of seeds and its score interval, by the effective number of games.

    That number is rate * (1 - rate) / variance of the mean over seeds: with one game a seed the number of games,
    with equal games in each seed the number of seeds. It never exceeds the number of games. Where all games are won,
    or none, the variance says nothing, and each seed counts as one game.

    Dean and Pagano, Journal of Survey Statistics and Methodology 3, 2015, section 2.

    Args:
        rates: the rate of each seed, from 0 to 1.
        games: the number of games of all seeds.
        confidence: the confidence level of the interval.
    """
    if not rates:
        return Interval(np.nan, np.nan, np.nan)
    rate = fmean(rates)
    variance = fmean((one - rate) ** 2 for one in rates) / len(rates)
    of_one_game = rate * (1.0 - rate)
    if of_one_game == 0.0:
        effective = float(len(rates))
    elif variance * games <= of_one_game:
        effective = float(games)
    else:
        effective = of_one_game / variance
    return estimate_rate(rate * effective, effective, confidence)


def compare_pairs(differences: Sequence[float] | FloatArray, confidence: float = 0.95) -> PairedComparison:
    """Compare two paired series by the differences of their pairs.

    The interval is that of `estimate_mean`; d_z is of Cohen, Statistical Power Analysis, 1988, 2.3.5; p is that of the
    permutation test that draws the signs (Fisher, The Design of Experiments, 1935, section 21), exact for at most 13
    pairs, else at least `LEAST_P`.

    Raises:
        MissingExtra: SciPy is not installed.
    """
    given = np.asarray(differences, float)
    interval = estimate_mean(given, confidence)
    if len(given) < 2:
        return PairedComparison(*interval, np.nan, np.nan)
    spread = float(given.std(ddof=1))
    if not given.any():
        return PairedComparison(*interval, 0.0, 1.0)
    effect = interval.value / spread if spread else float(np.copysign(np.inf, interval.value))
    test = _import_stats().permutation_test(
        (given,),
        np.mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=_PERMUTATIONS,
        batch=max(1, _CELLS // len(given)),
        random_state=np.random.default_rng(_SEED),
    )
    return PairedComparison(*interval, effect, float(test.pvalue))


def estimate_ratio(parts: FloatArray, wholes: FloatArray, confidence: float = 0.95) -> Interval:
    """Return the sum of parts divided by the sum of wholes, with its percentile bootstrap interval over the pairs.

    All numbers are NaN unless the wholes are significantly larger than 0, by the test of `compare_pairs`.

    Raises:
        MissingExtra: SciPy is not installed.
    """
    test = compare_pairs(wholes, confidence)
    if not (test.difference > 0.0 and test.p <= 1.0 - confidence):
        return Interval(np.nan, np.nan, np.nan)
    pairs = len(wholes)
    counts = np.random.default_rng(_SEED).multinomial(pairs, np.full(pairs, 1.0 / pairs), size=_RESAMPLES)
    counts = counts[counts @ wholes > 0.0]
    ends = np.quantile(counts @ parts / (counts @ wholes), ((1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0))
    return Interval(float(parts.sum() / wholes.sum()), *ends.tolist())


def count_seeds_needed(spread: float, difference: float, power: float, alpha: float) -> int:
    """Return the number of pairs that a two-sided paired test needs.

    The normal approximation with the correction for an estimated standard deviation (Guenther, The American
    Statistician 35, 1981): ((z_alpha + z_power) * spread / difference)^2 + z_alpha^2 / 2. It is at least the number
    of pairs of which a permutation test can give a p of `alpha`: 2 / 2^pairs.

    Args:
        spread: the standard deviation of the differences of pairs.
        difference: the mean difference to be found.
        power: the probability of finding it.
        alpha: the level of the test.
    """
    z_alpha = NormalDist().inv_cdf(1.0 - alpha / 2.0)
    z_power = NormalDist().inv_cdf(power)
    needed = ((z_alpha + z_power) * spread / difference) ** 2 + z_alpha**2 / 2.0
    return max(math.ceil(needed), math.ceil(math.log2(2.0 / alpha)))


def correct_by_holm(p: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number (Holm, Scandinavian Journal of Statistics 6, 1979)."""
    order = np.argsort(p, kind="stable")
    scaled = np.asarray(p, float)[order] * (len(p) - np.arange(len(p)))
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return [float(one) for one in adjusted]


# -- samples ------------------------------------------------------------------------------------------------------


def sample_points(n: int, size: int, method: str, seed: int) -> FloatArray:
    """Return points of the unit cube, (n, size): a Sobol sequence, a Latin hypercube, or drawn independently.

    Raises:
        MissingExtra: SciPy is not installed, which the first two need.
    """
    rng = np.random.default_rng(seed)
    if method == "random":
        return rng.random((n, size))
    qmc = _import_stats().qmc
    points: FloatArray = (qmc.Sobol if method == "sobol" else qmc.LatinHypercube)(size, seed=rng).random(n)
    return points


def estimate_sobol_indices(values: FloatArray, keys: int, confidence: float = 0.95) -> list[tuple[Interval, Interval]]:
    """Return the first-order and the total index of each key, with percentile bootstrap intervals.

    First order by Saltelli et al., Computer Physics Communications 181, 2010, equation (b) of table 2; total by Jansen,
    Computer Physics Communications 117, 1999, equation (f) there.

    Args:
        values: the results of A, of B, and of A with each key of B, ((keys + 2) * n,).
        keys: the number of keys.
        confidence: the confidence level of the intervals.

    Raises:
        BadValue: a value is missing, or all are equal.
    """
    blocks = np.asarray(values, float).reshape(keys + 2, -1)
    if not np.isfinite(blocks).all():
        raise BadValue(f"{int((~np.isfinite(blocks)).sum())} points of the sample have no value: their games raised.")
    if np.ptp(blocks[:2]) == 0.0:
        raise BadValue("All points of the sample have the same value, so no key has an influence on it.")
    n = blocks.shape[1]
    drawn = np.random.default_rng(_SEED).integers(n, size=(_RESAMPLES, n))
    tail = (1.0 - confidence) / 2.0
    per_batch = max(1, _CELLS // blocks.size)
    firsts = [*range(0, _RESAMPLES, per_batch), _RESAMPLES]
    resampled = np.concatenate([_resample_indices(blocks, drawn[a:b]) for a, b in pairwise(firsts)])
    low, high = np.nanquantile(resampled, (tail, 1.0 - tail), axis=0)
    found = _resample_indices(blocks, np.arange(n)[None])[0]
    made = [
        [Interval(*map(float, one)) for one in zip(found[order], low[order], high[order], strict=True)]
        for order in (0, 1)
    ]
    return list(zip(*made, strict=True))


def _resample_indices(blocks: FloatArray, drawn: IntArray) -> FloatArray:
    """Return the indices of resamples, (resamples, 2, keys)."""
    first = blocks[0][drawn]
    second = blocks[1][drawn]
    mixed = blocks[2:][:, drawn]
    both = np.concatenate((first, second), axis=-1)
    variance = both.var(axis=-1)
    centred = second - both.mean(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        of_first = (centred * (mixed - first)).mean(axis=-1) / variance
        of_total = ((first - mixed) ** 2).mean(axis=-1) / (2.0 * variance)
    return np.stack((of_first, of_total)).transpose(2, 0, 1)


def _import_stats() -> Any:
    with require_extra("An interval or a sample", "accel"):
        import scipy.stats
    return scipy.stats
