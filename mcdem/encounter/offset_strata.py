"""Which offsets to draw so that the probability of an outcome is known with the least work: stratified sampling by offset.

In simple shear the offset has the density of the flux, g y inside the half circle of radius R_i + R_j (Frungieri & Vanni 2021,
Fig. 3).  In units of that radius

    u = 1 - (1 - y^2)^(3/2),   v = |x|/sqrt(1 - y^2)

are independent and uniform between 0 and 1, so the half circle is a unit square on which area is flux.  Aggregation happens at
small u, in a tenth of the flux; so the square is cut at u = 1/256, 1/128 ... 1/2, and in four along v.

Encounters come in rounds.  A round takes n_h >= 1 encounters from each stratum h of flux W_h, as many as past rounds say
(Neyman 1934): in proportion to W_h sqrt(p_h (1 - p_h)/c_h), with c_h the work of an encounter there.  Its estimate

    p_t = sum_h W_h k_h/n_h

is unbiased whatever was seen before, since what a round takes is fixed before it begins.  Rounds are joined in proportion to
their lengths n_t, which depend on nothing that was seen, and the mean, sum_t n_t p_t/n, of a given number of rounds has no bias
either.  (Joined stratum by stratum it had: a stratum whose first encounters happened to miss would be visited less.)  To stop
when the error is small enough biases it by a part of order of that error squared, as with plain sampling.  So the weight of an
encounter is n_t W_h/n_h, one in the mean, and every mean over encounters with their weights is one over the flux.  Weights
are bounded, as no n_h is 0.

The variance is sum_t (n_t/n)^2 sum_h W_h^2 p_h (1 - p_h)/n_h with p_h of all rounds.  Strata without a single hit would add
nothing, however large they are: half a hit where it would weigh most stands for what they may hide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

U_EDGES = np.array([0.0, *(2.0**-k for k in range(8, -1, -1))])
V_EDGES = np.linspace(0.0, 1.0, 5)
SHARE = np.outer(np.diff(U_EDGES), np.diff(V_EDGES)).ravel()
"""(H,) flux W_h of each stratum over that of the circle."""
STRATA = SHARE.size
SHORTEST = 8 * STRATA
"""Encounters of the first rounds."""
GROWTH = 0.3
"""Length of a later round over all encounters before it: so much is computed beyond what was needed, at most."""
UNSEEN = 0.125
"""Hits, and misses, that a stratum is taken to have had besides those seen when the next round is allotted: none is given up.
In repeats on a core with a far tail, 95 % intervals held the truth in 0.94; with 0.03 and shorter rounds, in 0.88."""
INSIDE = 1.0 - 1e-9
"""Offsets are drawn so little within the circle, for rounding."""
WIDTH = 1.96
"""Of a 95 % interval, in standard errors."""


def round_length(done: int) -> int:
    """Encounters of the round that begins after `done`."""
    return max(SHORTEST, math.ceil(GROWTH * done))


def draw_in(stratum: int, reach: float, rng: np.random.Generator) -> tuple[float, float]:
    """An offset [m] by the flux within a stratum of the circle of radius `reach` [m]."""
    k, m = divmod(stratum, V_EDGES.size - 1)
    u = U_EDGES[k] + (U_EDGES[k + 1] - U_EDGES[k]) * (1.0 - rng.random())  # above 0: y = 0 never meets
    v = V_EDGES[m] + (V_EDGES[m + 1] - V_EDGES[m]) * rng.random()
    rest = (1.0 - u) ** (1.0 / 3.0)  # sqrt(1 - y^2)
    x = math.copysign(v * rest, rng.random() - 0.5)
    return INSIDE * reach * x, INSIDE * reach * math.sqrt(1.0 - rest * rest)


@dataclass(frozen=True, eq=False)
class Tally:
    """A whole round, by stratum: encounters, hits, unresolved encounters, and work (H,)."""

    trials: NDArray[np.int64]
    hits: NDArray[np.int64]
    unresolved: NDArray[np.int64]
    work: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        stratum: NDArray[np.intp],
        hit: NDArray[np.bool_],
        unresolved: NDArray[np.bool_],
        work: NDArray[np.float64],
    ) -> Tally:
        """Of encounters (n,)."""
        count = lambda of: np.bincount(stratum[of], minlength=STRATA)
        every = np.ones(len(stratum), bool)
        spent = np.bincount(stratum, work, STRATA).astype(float)
        return cls(count(every), count(hit), count(unresolved), spent)


def allotted(rounds: Sequence[Tally], length: int) -> NDArray[np.int64]:
    """(H,) encounters of a round of so many in each stratum, at least one; evenly before anything is known."""
    deviation = np.ones(STRATA)
    if rounds:
        trials, hits, work = (
            np.sum([getattr(one, of) for one in rounds], axis=0) for of in ("trials", "hits", "work")
        )
        p = (hits + UNSEEN) / (trials + 2.0 * UNSEEN)
        deviation = SHARE * np.sqrt(p * (1.0 - p) * trials / work)
    exact = 1.0 + (length - STRATA) * deviation / deviation.sum()
    whole = np.floor(exact).astype(np.int64)
    whole[np.argsort(whole - exact, kind="stable")[: length - whole.sum()]] += 1
    return whole


def weights(trials: NDArray[np.int64]) -> NDArray[np.float64]:
    """(H,) weight n_t W_h/n_h of an encounter of a round of `trials` (H,) in each stratum."""
    return np.asarray(trials.sum() * SHARE / trials)


@dataclass(frozen=True)
class Estimate:
    """A probability per encounter, its standard error and the ends of its 95 % interval; unresolved encounters are left out."""

    value: float
    deviation: float
    low: float
    high: float
    unresolved: float

    @property
    def relative(self) -> float:
        """Standard error over the value; inf where nothing was hit."""
        return self.deviation / self.value if self.value > 0.0 else math.inf


def estimate(rounds: Sequence[Tally]) -> Estimate:
    """What whole rounds say."""
    length = np.array([one.trials.sum() for one in rounds])
    part = length / length.sum()
    trials, hits = (np.sum([getattr(one, of) for one in rounds], axis=0) for of in ("trials", "hits"))
    p = hits / trials
    spread = SHARE**2 * p * (1.0 - p) * trials / np.maximum(trials - 1, 1)
    mean = lambda column: float(sum(c * (SHARE @ (k / t.trials)) for c, k, t in zip(part, column, rounds)))
    variance = float(sum(c**2 * (spread / t.trials).sum() for c, t in zip(part, rounds)))
    if (hits == 0).any():
        variance += 0.5 * float(np.max((SHARE / trials)[hits == 0])) ** 2
    lost = mean([t.unresolved for t in rounds])
    resolved = max(1.0 - lost, 1e-300)
    value, deviation = mean([t.hits for t in rounds]) / resolved, math.sqrt(variance) / resolved
    return Estimate(
        value, deviation, max(value - WIDTH * deviation, 0.0), min(value + WIDTH * deviation, 1.0), lost
    )
