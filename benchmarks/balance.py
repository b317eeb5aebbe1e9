"""The bivariate balance with collisional breakup, timed: right-hand side, Jacobian, steady state; one thread.

python benchmarks/balance.py
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numba
import numpy as np
from scipy import linalg
from threadpoolctl import threadpool_limits

from pbekit import (
    Aggregation,
    Cells,
    CollisionalBreakup,
    Grid,
    PopulationBalance,
    Restructuring,
    steady_state,
)
from pbekit.balance.breakage import CriticalSize, TwoPeak
from pbekit.balance.kernels import Kernel, ShearEncounter

RADIUS, SHEAR_RATE, VOLUME_FRACTION, EFFICIENCY = 500e-9, 1e4, 1e-4, 0.1


class Outcome(Kernel):
    """Share of encounters that join, or that break, with a critical joint size of 20."""

    def __init__(self, breaks: bool):
        self.breaks, self.law = breaks, CriticalSize(1000.0, 1000.0, 20.0)

    def __call__(self, i: Cells, j: Cells):
        """Probability for two aggregates."""
        p = self.law.of_pair(i, j)
        return EFFICIENCY * (p if self.breaks else 1 - p)


def suspension(sizes: int, shapes: int, restructuring: bool, scheme: str = "fixed pivot"):
    """A balance of `sizes` x `shapes` classes and its initial population."""
    exact = sizes // 2
    for ratio in np.linspace(1.05, 1.6, 300):
        grid = Grid.primaries(exact, largest=20 * exact, ratio=ratio)
        if grid.sizes <= sizes:
            break
    grid = grid.with_shapes(np.linspace(1, 4, shapes + 1))
    grid = grid.with_outer_radius(
        lambda p, s: RADIUS * np.where(p < 3, p, (p / 1.2) ** 0.55 * np.nan_to_num(s, nan=1.0) ** 0.3)
    )
    share = np.exp(-np.linspace(0, 3, shapes))
    share /= share.sum()
    meet = ShearEncounter(SHEAR_RATE)
    events = [
        Aggregation(meet * Outcome(False), share),
        CollisionalBreakup(meet * Outcome(True), TwoPeak(), share[::-1].copy()),
    ]
    if restructuring:
        events.append(
            Restructuring(meet * 0.9, np.full((shapes, shapes), 0.2 / shapes) + 0.8 * np.eye(shapes))
        )
    number = VOLUME_FRACTION / (4 / 3 * np.pi * RADIUS**3)
    return PopulationBalance(grid, events, scheme, edge="closed"), grid.monodisperse(number)


def milliseconds(function: Callable, repeats: int) -> tuple[float, float]:
    """(best, median) processor time of a call, after one that compiles."""
    function()
    took = []
    for _ in range(repeats):
        begun = time.process_time()
        function()
        took.append(1e3 * (time.process_time() - begun))
    return min(took), statistics.median(took)


def main():
    """Print one line per balance."""
    print("best (median) processor time in ms; steady state from free primaries, to a residual of 1e-11")
    for sizes, shapes, restructuring, scheme in (
        (20, 5, False, "fixed pivot"),
        (40, 10, False, "fixed pivot"),
        (40, 10, True, "fixed pivot"),
        (40, 10, False, "cell average"),
    ):
        balance, start = suspension(sizes, shapes, restructuring, scheme)
        state = balance.state(start * 0 + start.sum() / balance.cells**1.5)
        rhs = milliseconds(lambda b=balance, s=state: b.rhs(0.0, s), 300)
        jacobian = milliseconds(lambda b=balance, s=state: b.jacobian(0.0, s), 30)
        matrix = balance.jacobian(0.0, state) - np.eye(state.size)
        factor = milliseconds(lambda m=matrix: linalg.lu_factor(m), 30)
        settled = milliseconds(lambda b=balance, s=start: steady_state(b, s), 3)
        found = steady_state(balance, start)
        mean = found.population @ balance.grid.mass / found.population.sum()
        name = f"{balance.grid.sizes} x {shapes} = {balance.cells} cells, {scheme}" + (
            ", restructuring" if restructuring else ""
        )
        print(
            f"{name:50s} rhs {rhs[0]:.3f} ({rhs[1]:.3f})  Jacobian {jacobian[0]:.2f} ({jacobian[1]:.2f})  "
            f"LU {factor[0]:.1f}  steady state {settled[0]:.0f} ({settled[1]:.0f}), <P> = {mean:.2f}, "
            f"residual {found.residual:.0e}"
        )


if __name__ == "__main__":
    numba.set_num_threads(1)
    with threadpool_limits(1):
        main()
