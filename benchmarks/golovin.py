"""Golovin's kernel to b V t = 5.4: pbekit beside PySDM, one thread, in one process.

The case of Shima et al. (2009): droplets, number 2^23 per m^3, exponential volumes of mean (4/3) pi (30.531 um)^3,
K = b (v_i + v_j) with b = 1500 /s, one hour.  The second moment grows by exp(10.8) = 49 000; it is what tells solvers
apart.

    pip install PySDM
    python benchmarks/golovin.py

PySDM is used here only; without it the benchmark prints pbekit's lines alone.
"""

from __future__ import annotations

import statistics
import time

import numba
import numpy as np
from threadpoolctl import threadpool_limits

from pbekit import Aggregation, Grid, PopulationBalance, integrate
from pbekit.kernels import Sum, exponential_below

NUMBER = 2.0**23  # [1/m^3]
VOLUME = 4 / 3 * np.pi * (30.531e-6) ** 3  # [m^3]
RATE = 1500.0  # b [1/s]
DURATION = 3600.0  # [s]
EXACT = Sum(RATE).exact_moments(DURATION, NUMBER, VOLUME)


def solve_pbekit(scheme: str, ratio: float):
    """Moments (M0, M1, M2) at the end.  The grid spans the masses that hold number at the start and mass at the end."""
    grid = Grid.geometric(1e-4 * VOLUME, 4e6 * VOLUME, ratio)
    population = grid.from_cumulative(*exponential_below(NUMBER, VOLUME))
    balance = PopulationBalance(grid, [Aggregation(Sum(RATE))], scheme)
    end = integrate(balance, population, [0, DURATION], rtol=1e-4, atol=1e-7 * population.max())[-1]
    n = end[: grid.cells]
    return grid.cells, [n @ grid.pivots**k for k in range(3)]


def solve_pysdm(droplets: int, step: float, seed: int):
    """Wall time and moments at the end, from super-droplets; PySDM's own example of this case steps by 1 s."""
    from PySDM import Formulae, Particulator
    from PySDM.backends import CPU
    from PySDM.dynamics import Coalescence
    from PySDM.dynamics.collisions.collision_kernels import Golovin
    from PySDM.environments import Box
    from PySDM.initialisation.sampling.spectral_sampling import ConstantMultiplicity
    from PySDM.initialisation.spectra import Exponential

    space = 1e6  # [m^3]
    spectrum = Exponential(norm_factor=NUMBER * space, scale=VOLUME)
    attributes = dict(
        zip(("volume", "multiplicity"), ConstantMultiplicity(spectrum).sample_deterministic(droplets))
    )
    particulator = Particulator(
        droplets,
        environment=Box(dt=step, dv=space, backend=CPU(Formulae(seed=seed))),
        attributes=attributes,
        dynamics=(Coalescence(collision_kernel=Golovin(b=RATE), adaptive=False),),
    )
    begun = time.perf_counter()
    particulator.advance(round(DURATION / step))
    took = time.perf_counter() - begun
    volume = particulator.attributes["volume"].to_ndarray()
    multiplicity = particulator.attributes["multiplicity"].to_ndarray()
    return took, [float((multiplicity * volume**k).sum() / space) for k in range(3)]


def report(name, took, runs):
    """One line: median wall time, mean errors of number and mass, root mean square error of M2 over the runs."""
    errors = 100 * (np.array(runs) / EXACT - 1)
    m0, m1 = errors[:, 0].mean(), errors[:, 1].mean()
    second = np.sqrt((errors[:, 2] ** 2).mean())
    each = ", ".join(f"{e:+.1f}" for e in errors[:, 2])
    print(
        f"{name:36s} {took:8.4f} s   M0 {m0:+7.3f} %   M1 {m1:+7.3f} %   M2 rms {second:5.1f} %  ({each})",
        flush=True,
    )
    return name, took, second


def main():
    """Print one line per solver and the ratios of wall times."""
    print(
        f"exact: M2/M2(0) = {EXACT[2] / (2 * NUMBER * VOLUME**2):.0f}; wall times are medians of five warm runs"
    )
    ours = []
    for scheme, ratio in (("fixed pivot", 2**0.25), ("cell average", 2**0.5), ("cell average", 2**0.25)):
        solve_pbekit(scheme, ratio)
        took = []
        for _ in range(5):
            begun = time.perf_counter()
            cells, moments = solve_pbekit(scheme, ratio)
            took.append(time.perf_counter() - begun)
        ours.append(report(f"pbekit, {scheme}, {cells} cells", statistics.median(took), [moments]))
    try:
        import PySDM
    except ImportError:
        print("PySDM is not installed: pip install PySDM")
        return
    peers = []
    for droplets, step in ((2**13, 1.0), (2**13, 5.0), (2**15, 1.0), (2**15, 5.0)):
        solve_pysdm(droplets, 60.0, 0)
        runs = [solve_pysdm(droplets, step, seed) for seed in range(1, 6)]
        name = f"PySDM {PySDM.__version__}, 2^{int(np.log2(droplets))}, step {step:g} s"
        peers.append(report(name, statistics.median(t for t, _ in runs), [m for _, m in runs]))
    for name, took, error in peers:
        best = min((t for _, t, e in ours if e <= error), default=None)
        if best is None:
            print(f"{name}: no pbekit line has as small an M2 error")
        else:
            print(f"{name}: pbekit is {took / best:.0f} times faster at equal M2 error or better")


if __name__ == "__main__":
    numba.set_num_threads(1)
    with threadpool_limits(1):
        main()
