"""Which encounters the next round should sample: by what pairs of classes contribute to the error of the steady mean size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcdem.kernel_tables.library import Library
from mcdem.quantities.random_streams import stream
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for
from pbekit.solution.steady import NotReachedError, steady_state
from pbekit.study.evidence import Evidence, counted, judged
from pbekit.study.uncertainty import VarianceShares, mean_size_gradient, variance_shares
from pbekit.tables.kernel_table import KernelTable

ROUND = 200
"""Designed encounters between two updates of the estimate."""


@dataclass(frozen=True)
class Plan:
    """The encounters of a round: pairs of classes, and what the records so far say of the steady mean size."""

    pairs: NDArray[np.intp]
    mean_size: float | None = None
    error: float | None = None
    """Relative standard error of the steady <P>; None, as the size, where encounters that were seen bear none yet."""
    refusal: str = ""
    """Why there is no steady state, and what would give one."""


def steady_shares(table: KernelTable, volume_fraction: float) -> tuple[float, VarianceShares]:
    """Steady <P> of the balance on the table, and where its variance comes from.

    Parameters
    ----------
    table : KernelTable
        With encounters enough for a steady state.
    volume_fraction : float
        Of primaries [-].

    Returns
    -------
    mean_size : float
        Steady <P>.
    shares : VarianceShares
        Whose `deviation` is its standard error, and whose `largest` are the pairs of classes that make it.

    Raises
    ------
    PBEError
        Where encounters that were seen bear no steady state, with what is missing.
    """
    value, shares, evidence = _shares(table, volume_fraction)
    if value is None or shares is None or not evidence.holds:
        raise PBEError(evidence.refusal(table))
    return value, shares


def _shares(
    table: KernelTable, volume_fraction: float
) -> tuple[float | None, VarianceShares | None, Evidence]:
    """Steady <P> and variance shares, None where sizes only grow; and whether encounters that were seen bear them."""
    estimated = EstimatedRates(table, grid_for(table))
    evidence = counted(estimated)
    if evidence.breakups == 0:
        return None, None, evidence
    number = volume_fraction / (4 / 3 * np.pi * table.radius**3)
    try:
        steady = steady_state(estimated.mean, estimated.grid.monodisperse(number))
    except NotReachedError:
        return None, None, replace(evidence, moved=np.inf)
    gradient = mean_size_gradient(estimated.mean, steady.population)
    shares = variance_shares(estimated, steady, gradient)
    if evidence.holds:
        evidence = judged(estimated, steady)
    return number / float(steady.population.sum()), shares, evidence


def plan(
    table: KernelTable, library: Library, volume_fraction: float, seed: int, done: int, primaries: int = 0
) -> Plan:
    """What the next round should sample: by variance shares, or evenly where no steady state is in sight.

    primaries : encounters of two primaries that come before any others
    """
    b, a = np.tril_indices(table.classes)
    possible = library.has(a, b)
    rng = stream(seed, "kernel design", done)
    mean_size = error = None
    trials = table.counts.sum(axis=1)
    # Where too little is known: the fewer the trials of a pair, the more likely it is.
    weight = possible / (1.0 + trials)
    try:
        value, shares, evidence = _shares(table, volume_fraction)
    except PBEError as problem:
        shares, refusal = None, f"no steady state: {problem}"
    else:
        refusal = "" if evidence.holds else evidence.refusal(table)
        if shares is not None and value is not None and not refusal:
            mean_size, error = value, shares.deviation / value
    if shares is not None:
        spent = np.bincount(table.pair, table.records.work, table.pairs)
        cost = np.divide(spent, trials, out=np.zeros(table.pairs), where=trials > 0)
        wanted = np.where(possible, shares.next_trials(8 * ROUND, cost), 0)
        # A steady state that nothing bears says little of where to look: then half of the encounters go where few were.
        even = 0.5 if refusal else 0.0
        if wanted.sum() > 0:
            weight = even * weight / weight.sum() + (1.0 - even) * wanted / wanted.sum()
    weight = weight / weight.sum()
    pairs = rng.choice(table.pairs, ROUND, p=weight)
    pairs[: max(0, primaries - int(table.counts[0].sum()))] = 0
    return Plan(pairs, mean_size, error, refusal)
