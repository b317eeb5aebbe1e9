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
