"""Limits of shares and rates that were counted, zero and small counts included."""

from __future__ import annotations

import numpy as np
from scipy import stats

from pbekit.arguments import LEVEL


def share_interval(count: int, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Interval of a probability from `count` of `trials` (Wilson 1927).

    Its mean coverage is near `level` down to a few trials; for no count it starts at 0, for all it ends at 1, and without
    trials it is 0 to 1.

    Parameters
    ----------
    count, trials : int
        How many of how many.
    level : float
        Of the interval [-].

    Returns
    -------
    (float, float)
        Its ends [-].

    Examples
    --------
    >>> from pbekit.tables import share_interval
    >>> [round(value, 3) for value in share_interval(0, 10, 0.9)]
    [0.0, 0.213]
    """
    if trials == 0:
        return 0.0, 1.0
    found = stats.binomtest(int(count), int(trials)).proportion_ci(level, method="wilson")
    return float(found.low), float(found.high)


def weighted_share(hit: np.ndarray, weight: np.ndarray, level: float = LEVEL) -> tuple[float, float, float]:
    """Share of encounters with their weights, and its interval: Wilson's of as many trials as leave the same variance.

    The variance of p = sum w h/sum w is sum w^2 (h - p)^2/(sum w)^2, to first order.  What strata took away from it is
    left out, so the interval is on the safe side.  Where all count alike it is `share_interval`.

    Parameters
    ----------
    hit : (n,) array of bool
        Which had the outcome.
    weight : (n,) array
        Of each.
    level : float
        Of the interval [-].

    Returns
    -------
    (float, float, float)
        The share and the ends of its interval [-]; nan and 0 to 1 without any weight.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit.tables import weighted_share
    >>> value, low, high = weighted_share(np.array([True, True, False, False]), np.array([0.5, 0.5, 1.5, 1.5]))
    >>> value
    0.25
    """
    hit, weight = np.asarray(hit, bool), np.asarray(weight, float)
    total = weight.sum()
    if not total > 0.0:
        return np.nan, 0.0, 1.0
    if (weight == 1.0).all():
        return float(hit.mean()), *share_interval(int(hit.sum()), hit.size, level)
    p = float(weight[hit].sum() / total)
    variance = float((weight**2 * (hit - p) ** 2).sum() / total**2)
    trials = p * (1.0 - p) / variance if 0.0 < p < 1.0 else total**2 / float((weight**2).sum())
    z = stats.norm.ppf(0.5 * (1.0 + level))
    middle, half = p + z**2 / (2 * trials), z * np.sqrt(p * (1 - p) / trials + z**2 / (4 * trials**2))
    norm = 1.0 + z**2 / trials
    return p, float(max((middle - half) / norm, 0.0)), float(min((middle + half) / norm, 1.0))


def share_limit(trials: int, level: float = 0.95) -> float:
    """The probability that an outcome not seen in `trials` stays below, at this one-sided level (Clopper & Pearson 1934)."""
    return 1.0 if trials == 0 else float(1.0 - (1.0 - level) ** (1.0 / trials))


def count_interval(count: int, level: float = LEVEL) -> tuple[float, float]:
    """Interval of an expected number of which `count` came (Poisson; Garwood 1936): exact, hence on the safe side.

    Parameters
    ----------
    count : int
        How many came.
    level : float
        Of the interval [-].

    Returns
    -------
    (float, float)
        Its ends.

    Examples
    --------
    >>> from pbekit.tables import count_interval
    >>> [round(value, 2) for value in count_interval(4, 0.95)]
    [1.09, 10.24]
    """
    tail = 0.5 * (1.0 - level)
    low = 0.0 if count == 0 else float(stats.chi2.ppf(tail, 2 * count) / 2)
    return low, float(stats.chi2.ppf(1.0 - tail, 2 * count + 2) / 2)


def share_in_words(count: int, trials: int, level: float = LEVEL) -> str:
    """As it is printed: "3.1 % (2.4 to 4 %)", and "below 0.5 %" for none."""
    if trials == 0:
        return "no trial"
    if count == 0:
        return f"0 of {trials}, below {100 * share_limit(trials):.2g} %"
    low, high = np.multiply(100, share_interval(count, trials, level))
    return f"{100 * count / trials:.3g} % ({low:.3g} to {high:.3g} %)"
