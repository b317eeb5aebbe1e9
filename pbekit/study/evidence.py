"""Whether a steady state rests on encounters that were seen; where it does not, what is missing and how to get it.

A balance can always be solved: where nothing was seen a law stands in, and where nothing breaks sizes grow until the last
class of the grid holds them.  Such an answer is about the law or the grid, not about the suspension, so it is refused:

breakups    too few encounters left more aggregates than entered, or none
edge        the mean size moves when the grid is made to end at twice its size
sampling    more than a few per cent of what changes sizes, in number or in mass, meets in classes that nobody sampled
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pbekit.balance.grid import Grid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.solution.steady import NotReachedError, SteadyState, steady_state
from pbekit.tables.counts import share_limit
from pbekit.tables.kernel_table import KernelTable

LEAST_BREAKUPS = 100
"""Encounters with more products than parents.  95 % intervals of the steady <P> on synthetic tables of run-like encounters hold
the truth in 0.74 of the cases with 50, 0.80 with 65, 0.89 with 85, and 0.94 with 100: below, fragments are borrowed from pairs
that are too unlike (tests/pbekit/test_pbe_evidence.py)."""
MOST_EXTRAPOLATED = 0.05
"""Share of the encounters that change sizes, or of the mass in them, that may meet in classes that nobody sampled."""
MOST_MOVED = 0.01
"""Relative change of the steady <P> that a grid of twice the end may make."""
NO_EDGE = 1e-6
"""Share of the mass flux beyond the grid below which its end surely does not matter."""
WANTED_TRIALS = 20
"""Encounters in a pair of classes from which on its own counts outweigh the law (`estimated rates.STRONGEST_PRIOR`)."""


@dataclass(frozen=True)
class MissingPair:
    """A pair of classes that matters and was not sampled: its name, share of the mass in changes of size, and trials."""

    name: str
    share: float
    trials: int


@dataclass(frozen=True)
class Evidence:
    """What a steady state rests on.

    encounters, breakups : resolved encounters of the table, and those with more products than parents (of two tables, where
        the balance lies between them: the smaller numbers)
    extrapolated : share of the encounters that change sizes which meet in pairs of classes nobody sampled
    extrapolated_mass : the same, each encounter weighted with its mass
    edge_flux : mass of products beyond the grid over the mass that passes through its classes
    moved : relative change of <P> on a grid that ends at twice the size; 0 where edge_flux is below `NO_EDGE`
    largest : largest joint size that met
    missing : the pairs of classes that make most of `extrapolated_mass`

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates, start_of
    >>> from pbekit.study import supported_steady_state
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> estimated = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16, largest=60))
    >>> _, evidence = supported_steady_state(estimated, start_of(estimated.grid, table))
    >>> evidence.encounters, evidence.breakups, evidence.largest
    (400, 2, 39)
    """

    encounters: int
    breakups: int
    largest: int
    extrapolated: float = np.nan
    extrapolated_mass: float = np.nan
    edge_flux: float = np.nan
    moved: float = np.nan
    missing: tuple[MissingPair, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the steady state may be shown."""
        return not self.reasons

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why not, each in a phrase."""
        found = []
        if self.breakups == 0:
            found.append(
                f"none of {self.encounters} encounters broke an aggregate (below {100 * share_limit(self.encounters):.2g} % "
                f"do, among joint sizes up to {self.largest}), so sizes would grow to the end of any grid"
            )
        elif self.breakups < LEAST_BREAKUPS:
            found.append(
                f"only {self.breakups} of {self.encounters} encounters broke an aggregate, {LEAST_BREAKUPS} are needed"
            )
        if np.isinf(self.moved):
            found.append("sizes grow without end, or to the end of a longer grid")
        elif abs(self.moved) > MOST_MOVED:
            found.append(
                f"the mean size moves by {100 * self.moved:+.2g} % when the grid ends at twice its size"
            )
        if max(self.extrapolated, self.extrapolated_mass) > MOST_EXTRAPOLATED:
            found.append(
                f"{100 * self.extrapolated:.2g} % of the encounters that change sizes, with {100 * self.extrapolated_mass:.2g} % "
                "of the mass in them, are in classes that nobody sampled"
            )
        return tuple(found)

    def refusal(self, table: KernelTable) -> str:
        """One line: why there is no steady state, which classes are missing, and the command that would get them."""
        line = "no steady state: " + "; ".join(self.reasons)
        if self.missing:
            line += "; missing: " + ", ".join(
                f"{pair.name} ({100 * pair.share:.2g} % of the mass, {pair.trials} trials)"
                for pair in self.missing
            )
        return f"{line}. {self.cure(table)}"

    def cure(self, table: KernelTable) -> str:
        """The commands that would get what is missing."""
        scene = f"{table.about.get('scene_name', 'SCENE')}.toml"
        run = str(table.about.get("runs", "")).split(" ")[0] or "RUN.nc"
        if self.breakups < LEAST_BREAKUPS or (abs(self.moved) > MOST_MOVED and not self.missing):
            return (
                f"Let the run go on until aggregates break (mcdem run {scene} -o {run} --resume, with a later --until or more "
                "--events) and make the table again"
            )
        wanted = int(table.about.get("designed", 0)) + WANTED_TRIALS * max(len(self.missing), 10)
        return (
            f"Sample them (mcdem kernels {scene} --from {run} -o KERNELS --resume --encounters {wanted}); "
            f"if {run} holds no aggregates of these classes, let it go on first"
        )


class OnGrid(Protocol):
    """What can be judged: a `EstimatedRates`, or two (`between.InterpolatedRates`)."""

    grid: Grid

    def balance(
        self, rng: np.random.Generator | None = None, scheme: str = "fixed pivot"
    ) -> PopulationBalance: ...

    @property
    def tables(self) -> tuple[KernelTable, ...]: ...

    def on(self, grid: Grid) -> OnGrid: ...

    def extrapolated_changes(self, population: np.ndarray) -> tuple[float, float]: ...

    def missing_pairs(self, population: np.ndarray) -> list[tuple[str, float, int]]: ...


def breakups(table: KernelTable) -> int:
    """Encounters that left more aggregates than entered."""
    return int((table.records.products > 2).sum())


def counted(estimated: OnGrid) -> Evidence:
    """What can be said before anything is solved."""
    fewest = min(estimated.tables, key=breakups)
    largest = min(int(t.records.size.sum(axis=1).max()) for t in estimated.tables)
    return Evidence(len(fewest.records), breakups(fewest), largest)


def judged(estimated: OnGrid, steady: SteadyState) -> Evidence:
    """What the steady state of the balance of estimated rates rests on."""
    n = steady.population
    number, mass = estimated.extrapolated_changes(n)
    edge = steady.balance.edge_flux(n)
    moved = 0.0
    if edge > NO_EDGE:
        mean = n @ steady.balance.grid.mass / n.sum()
        moved = _on_a_longer_grid(estimated, n, steady.balance.scheme) / mean - 1.0
    missing: tuple[MissingPair, ...] = ()
    if max(number, mass) > MOST_EXTRAPOLATED:
        missing = tuple(MissingPair(*pair) for pair in estimated.missing_pairs(n)[:5])
    return replace(
        counted(estimated),
        extrapolated=number,
        extrapolated_mass=mass,
        edge_flux=float(edge),
        moved=float(moved),
        missing=missing,
    )


def _on_a_longer_grid(estimated: OnGrid, population: np.ndarray, scheme: str) -> float:
    """Steady <P> on a grid that ends at twice the size; inf where none is found."""
    longer = estimated.on(estimated.grid.extended(2.0))
    start = longer.grid.monodisperse(population @ estimated.grid.mass)
    try:
        n = steady_state(longer.balance(scheme=scheme), start).population
    except NotReachedError:
        return np.inf
    return float(n @ longer.grid.mass / n.sum())


def supported_steady_state(
    estimated: OnGrid, population: np.ndarray, *, scheme: str = "fixed pivot", guess: np.ndarray | None = None
) -> tuple[SteadyState | None, Evidence]:
    """The steady state of a table's balance where encounters that were seen bear it, else None; and the evidence.

    Parameters
    ----------
    estimated : a table on a grid
    population : (K,) initial numbers [1/m^3]
    scheme : of the balance
    guess : (K,) a population near the steady state

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates, start_of
    >>> from pbekit.study import supported_steady_state
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> estimated = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16, largest=60))
    >>> steady, evidence = supported_steady_state(estimated, start_of(estimated.grid, table))

    Four hundred designed encounters do not bear one:

    >>> steady is None, evidence.encounters, evidence.breakups
    (True, 400, 2)
    """
    evidence = counted(estimated)
    if not evidence.holds:
        return None, evidence
    try:
        steady = steady_state(estimated.balance(scheme=scheme), population, guess=guess)
    except NotReachedError:
        # Sizes that grow without end are not reached in any time.
        return None, replace(evidence, moved=np.inf)
    evidence = judged(estimated, steady)
    return (steady if evidence.holds else None), evidence
