"""Golovin's kernel to b V t = 5.4: pbekit beside PySDM, one thread, in one process.

The case of Shima et al. (2009): droplets, number 2^23 per m^3, exponential volumes of mean (4/3) pi (30.531 um)^3,
K = b (v_i + v_j) with b = 1500 /s, one hour.  The second moment grows by exp(10.8) = 49 000; it is what separates
solvers.

    pip install PySDM
    python benchmarks/golovin.py --seeds 8

Times are of the processor, medians of runs taken in turn, so that both meet the same load; PySDM's compilation and
initialisation are left out, pbekit's grid and assembly are in.  The error of PySDM's second moment is the mean over
seeds of its absolute value; pbekit's is that of the grid (found with tight tolerances) plus that of the integrator, so
that neither hides the other.  Three pivots keep the second moment by themselves, so the third says what their grid is worth.
Each setting of PySDM is set against the fastest of pbekit with no larger error.

PySDM is used here only; without it the benchmark prints pbekit's lines alone.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import NamedTuple

import numba
import numpy as np
from threadpoolctl import threadpool_limits

from pbekit import Aggregation, Grid, PopulationBalance, integrate
from pbekit.balance.kernels import Sum, exponential_below

NUMBER = 2.0**23  # [1/m^3]
VOLUME = 4 / 3 * np.pi * (30.531e-6) ** 3  # [m^3]
RATE = 1500.0  # b [1/s]
DURATION = 3600.0  # [s]
SPACE = 1e6  # [m^3]
EXACT = Sum(RATE).exact_moments(DURATION, NUMBER, VOLUME)
GROWN = np.exp(RATE * NUMBER * VOLUME * DURATION)
THIRD = NUMBER * VOLUME**3 * GROWN**3 * (6 + 12 * (GROWN - 1))
"""M3 at the end, by dM3/dt = 3 b (M1 M3 + M2^2)."""


class Setting(NamedTuple):
    """A grid, an integrator and its tolerances; the absolute one over the largest initial number."""

    scheme: str
    ratio: float
    method: str = "LSODA"
    rtol: float = 1e-4
    atol: float = 1e-7


SETTINGS = (
    Setting("fixed pivot", 2**0.25),
    Setting("cell average", 2**0.5, "RK23", 1e-3, 3e-7),
    Setting("cell average", 2**0.5, "LSODA", 1e-3, 1e-8),
    Setting("cell average", 2**0.25, "LSODA", 1e-3, 1e-8),
    Setting("three pivots", 2**0.5, "LSODA", 1e-4, 1e-9),
    Setting("three pivots", 2**0.25, "LSODA", 3e-5, 1e-10),
)
PEERS = ((2**13, 5.0), (2**13, 1.0), (2**15, 5.0), (2**15, 1.0))
"""Super-droplets and time step [s]; PySDM's own example of this case steps by 1 s."""


def solve_pbekit(scheme: str, ratio: float, method: str = "LSODA", rtol: float = 1e-4, atol: float = 1e-7):
    """Moments (M0, M1, M2, M3) at the end.  The grid spans the masses that hold number at the start and mass at the end."""
    grid = Grid.geometric(1e-3 * VOLUME, 3e6 * VOLUME, ratio)
    population = grid.from_cumulative(*exponential_below(NUMBER, VOLUME), scheme)
    balance = PopulationBalance(grid, [Aggregation(Sum(RATE))], scheme)
    tolerances = {"rtol": rtol, "atol": atol * population.max()}
    end = integrate(balance, population, np.array([0, DURATION]), method, **tolerances)[-1]
    n = end[: grid.cells]
    return grid.cells, [n @ grid.pivots**k for k in range(4)]


def error_of(setting: Setting) -> tuple[float, float, float, float]:
    """Relative errors of M0, M2 and M3 as found; of M2, that of the grid plus that of the integrator, in absolute value."""
    _, found = solve_pbekit(*setting)
    _, settled = solve_pbekit(setting.scheme, setting.ratio, "LSODA", 1e-7, 1e-11)
    second = (abs(settled[2] - EXACT[2]) + abs(found[2] - settled[2])) / EXACT[2]
    return found[0] / EXACT[0] - 1, found[2] / EXACT[2] - 1, found[3] / THIRD - 1, second


def _particulator(droplets: int, step: float, seed: int):
    from PySDM import Formulae, Particulator
    from PySDM.backends import CPU
    from PySDM.dynamics import Coalescence
    from PySDM.dynamics.collisions.collision_kernels import Golovin
    from PySDM.environments import Box
    from PySDM.initialisation.sampling.spectral_sampling import ConstantMultiplicity
    from PySDM.initialisation.spectra import Exponential

    spectrum = Exponential(norm_factor=NUMBER * SPACE, scale=VOLUME)
    attributes = dict(
        zip(("volume", "multiplicity"), ConstantMultiplicity(spectrum).sample_deterministic(droplets))
    )
    return Particulator(
        droplets,
        environment=Box(dt=step, dv=SPACE, backend=CPU(Formulae(seed=seed))),
        attributes=attributes,
        dynamics=(Coalescence(collision_kernel=Golovin(b=RATE), adaptive=False),),
    )


def solve_pysdm(droplets: int, step: float, seed: int):
    """Processor time [s] and moments at the end, from super-droplets."""
    # PySDM compiles anew for each seed: a first step does that, of another population.
    _particulator(droplets, step, seed).advance(1)
    particulator = _particulator(droplets, step, seed)
    begun = time.process_time()
    particulator.advance(round(DURATION / step))
    took = time.process_time() - begun
    volume = particulator.attributes["volume"].to_ndarray()
    multiplicity = particulator.attributes["multiplicity"].to_ndarray()
    return took, [float((multiplicity * volume**k).sum() / SPACE) for k in range(3)]


def seconds(setting: Setting) -> float:
    """Processor time of one solution, grid and assembly included."""
    begun = time.process_time()
    solve_pbekit(*setting)
    return time.process_time() - begun


def main(seeds: int):
    """Print one line per solver and the ratios of times."""
    growth = EXACT[2] / (2 * NUMBER * VOLUME**2)
    print(f"M2 grows {growth:.0f} times; medians of processor times over {seeds} seeds, taken in turn")
    for setting in SETTINGS:
        solve_pbekit(*setting)
    errors = {setting: error_of(setting) for setting in SETTINGS}
    took: dict[Setting, list[float]] = {setting: [] for setting in SETTINGS}
    peers: dict[tuple[int, float], list] = {peer: [] for peer in PEERS}
    try:
        import PySDM
    except ImportError:
        print("PySDM is not installed: pip install PySDM")
        peers = {}
    for seed in range(1, seeds + 1):
        for peer in peers:
            peers[peer].append(solve_pysdm(*peer, seed))
            for setting in SETTINGS:
                took[setting].append(seconds(setting))
        if not peers:
            for setting in SETTINGS:
                took[setting].append(seconds(setting))
    ours = {}
    for setting in SETTINGS:
        ours[setting] = statistics.median(took[setting])
        number, second, third, bound = errors[setting]
        name = f"pbekit, {setting.scheme}, ratio {setting.ratio:.2f}, {setting.method}"
        print(
            f"{name:42s} {ours[setting]:8.4f} s   M0 {100 * number:+7.3f} %   M2 {100 * second:+7.2f} % "
            f"(grid and integrator {100 * bound:.2f} %)   M3 {100 * third:+6.1f} %"
        )
    for (droplets, step), runs in peers.items():
        found = np.array([m for _, m in runs]) / EXACT - 1
        error, time_taken = np.abs(found[:, 2]).mean(), statistics.median(t for t, _ in runs)
        name = f"PySDM {PySDM.__version__}, 2^{int(np.log2(droplets))}, step {step:g} s"
        best = min((t for s, t in ours.items() if errors[s][-1] <= error), default=None)
        versus = (
            "no pbekit line is as exact"
            if best is None
            else f"pbekit is {time_taken / best:.0f} times faster"
        )
        print(
            f"{name:42s} {time_taken:8.4f} s   M0 {100 * found[:, 0].mean():+7.3f} %   "
            f"M2 {100 * error:7.2f} % (rms {100 * np.sqrt((found[:, 2] ** 2).mean()):.1f} %): {versus}",
            flush=True,
        )
    if peers:
        fastest = min(statistics.median(t for t, _ in runs) for runs in peers.values())
        exact = min(t for setting, t in ours.items() if errors[setting][-1] < 2e-3)
        print(
            f"to 0.2 % of M2 in {exact:.4f} s, {fastest / exact:.1f} times faster than PySDM's fastest setting"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=8)
    numba.set_num_threads(1)
    with threadpool_limits(1):
        main(parser.parse_args().seeds)
