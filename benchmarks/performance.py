"""The performance table: velocity solves against the dense floor, encounters against the paper's scheme, events a second.

    python benchmarks/performance.py                               velocity solves alone
    python benchmarks/performance.py --growth                      ... how they grow to N = 2000, with and without a matrix,
                                                                   and encounters to P = 200
    python benchmarks/performance.py --run RUN.nc --starts 20      ... and encounters of a steady population
    python benchmarks/performance.py --pecnut CHECKOUT             ... and Pecnut/stokesian-dynamics beside them

Everything is timed in one thread and in one run, so that ratios hold on any machine: of each solve the best of several
turns that go round all solvers, since a busy machine only adds; of encounters the process time.  The floor of a solve is the
Cholesky factor of a dense matrix of 11 N rows, which every direct method with forces, torques and stresslets has to make.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import scipy.linalg
import threadpoolctl

import mcdem
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.paired_encounters import draw_pairs, warm_up
from mcdem.quantities.random_streams import stream
from validation.hard_cases.shapes import ball_centres, settled

SIZES = (2, 10, 30, 100)
GAP = 0.05
"""Smallest gap of the random spheres, in radii."""


def random_spheres(count: int, seed: int) -> np.ndarray:
    """Positions (N, 3) in radii at a volume fraction of a fifth, no gap below GAP."""
    rng = np.random.default_rng(seed)
    side = (4.0 / 3.0 * np.pi * count / 0.2) ** (1.0 / 3.0)
    placed: list[np.ndarray] = []
    while len(placed) < count:
        new = side * rng.random(3)
        if all(np.linalg.norm(new - p) > 2.0 + GAP for p in placed):
            placed.append(new)
    return np.array(placed)


def best(functions: dict[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Shortest time [s] of each, going round all of them `turns` times after one that is not counted."""
    found = dict.fromkeys(functions, np.inf)
    for turn in range(turns + 1):
        for name, function in functions.items():
            started = time.perf_counter()
            function()
            if turn:
                found[name] = min(found[name], time.perf_counter() - started)
    return found


def solves(pecnut: Path | None) -> None:
    """Print the table of velocity solves."""
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    print("\nOne velocity solve, one thread (ms; ratio to the dense floor of 11 N rows)")
    print(f"{'N':>5} {'floor':>9} {'mcdem':>16} {'pecnut':>18}")
    for count in SIZES:
        positions = random_spheres(count, seed=count)
        rows = np.random.default_rng(0).normal(size=(11 * count, 11 * count))
        matrix = rows @ rows.T + 11 * count * np.eye(11 * count)
        functions: dict[str, Callable[[], object]] = {
            "floor": lambda matrix=matrix: scipy.linalg.cholesky(
                matrix, lower=True, overwrite_a=False, check_finite=False
            ),
            "mcdem": compiled_solve(scene, positions),
        }
        if pecnut is not None:
            functions["pecnut"] = pecnut_solve(pecnut, positions)
        found = best(functions, turns=max(3, 300 // count))
        line = f"{count:5d} {1e3 * found['floor']:9.4f} {1e3 * found['mcdem']:9.4f} ({found['mcdem'] / found['floor']:4.2f})"
        if "pecnut" in found:
            line += f" {1e3 * found['pecnut']:9.2f} ({found['pecnut'] / found['mcdem']:.0f} x)"
        print(line, flush=True)


def compiled_solve(scene: mcdem.Scene, positions: np.ndarray) -> Callable[[], object]:
    """The solve of the time loop, without the checks at the door of `mcdem.velocities`."""
    from mcdem.encounter.simulate import physics_of
    from mcdem.hydrodynamics.resistance import workspace
    from mcdem.hydrodynamics.velocities import solve_velocities

    flow, physics = physics_of(scene)
    n = len(positions)
    arguments = (
        physics.level,
        workspace(n),
        positions,
        np.ones(n),
        flow,
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.empty((n, 5)),
    )
    return lambda: solve_velocities(*arguments)


GROWTH = (2, 5, 10, 20, 50, 100, 200, 300, 400, 1000, 2000)
LARGEST_DENSE = 400


def growth() -> None:
    """Print how a solve grows with N on both paths, with fitted exponents, and the memory it adds."""
    from mcdem.encounter.simulate import physics_of
    from mcdem.hydrodynamics import matrix_free

    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    flow, physics = physics_of(scene)
    print("\nOne solve on all cores of this machine (s), random suspension at a volume fraction of a fifth")
    print(f"{'N':>5} {'dense':>9} {'matrix-free':>12} {'iterations':>10} {'memory so far, MB':>18}")
    found: dict[str, list[tuple[int, float]]] = {"dense": [], "matrix-free": []}
    for count in GROWTH:
        positions, none = random_spheres(count, seed=count), np.zeros((count, 3))
        arguments = (physics.level, positions, np.ones(count), flow, none, none)
        functions: dict[str, Callable[[], object]] = {}
        if count <= LARGEST_DENSE:
            functions["dense"] = compiled_solve(scene, positions)
        if count >= 50:
            functions["matrix-free"] = lambda arguments=arguments: matrix_free.solve_velocities(*arguments)
        times = best(functions, turns=3 if count >= 100 else 30)
        for name, seconds in times.items():
            found[name].append((count, seconds))
        cells = [f"{times[name]:.5f}" if name in times else "-" for name in found]
        iterations = matrix_free.solve_velocities(*arguments).iterations if count >= 50 else 0
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(f"{count:5d} {cells[0]:>9} {cells[1]:>12} {iterations or '-':>10} {memory:18.0f}", flush=True)
    for name, points in found.items():
        n, seconds = np.array([p for p in points if p[0] >= 100]).T
        print(f"time of {name} from N = 100 on: N^{np.polyfit(np.log(n), np.log(seconds), 1)[0]:.2f}")


PRIMARIES = (2, 6, 12, 24, 50, 100, 200)


def growth_of_encounters() -> None:
    """Print how one encounter grows with its number of primaries, with fitted exponents.

    Two compact balls pass so close that all primaries are followed, until they have parted; then nothing turns on.
    """
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
        {"numerics.rotations": 0.0, "numerics.sure_miss": 0.0, "flow.shear_stress": "500 Pa"}
    )
    warm_up(scene, (mcdem.Aggregate.monomer(), mcdem.Aggregate.monomer()))
    print("\nOne encounter of two balls of P/2 primaries at 500 Pa, one thread")
    print(f"{'P':>5} {'CPU, ms':>9} {'steps':>6} {'us a step':>10} {'outcome':>14} {'memory so far, MB':>18}")
    found = []
    for count in PRIMARIES:
        ball = settled(scene, ball_centres(count // 2))
        reach = 2.0 * ball.outer_radius(scene.suspension.radius)
        results = [
            mcdem.simulate_encounter(scene, ball, ball, offset=(0.0, share * reach), seed=0)
            for share in (0.5, 0.6, 0.7)
        ]
        cpu, steps = (float(np.mean([getattr(r, name) for r in results])) for name in ("cpu_time", "steps"))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        outcomes = ", ".join(sorted({r.outcome for r in results}))
        print(
            f"{count:5d} {1e3 * cpu:9.1f} {steps:6.0f} {1e6 * cpu / steps:10.0f} {outcomes:>14} {memory:18.0f}",
            flush=True,
        )
        found.append((count, cpu, cpu / steps))
    p, cpu, step = np.array([row for row in found if row[0] >= 12]).T
    for name, times in (("an encounter", cpu), ("a step", step)):
        print(f"time of {name} from P = 12 on: P^{np.polyfit(np.log(p), np.log(times), 1)[0]:.2f}")


_SAID: list[bool] = []


@contextmanager
def numba_kept_on() -> Iterator[list[str]]:
    """Within, `numba.config.DISABLE_JIT = True` has no effect; what was tried is in the list that is given.

    Functions are compiled or not when they are decorated, which is while a package is imported: to put the value back
    afterwards would be too late.
    """
    import types

    import numba

    tried: list[str] = []

    class KeptOn(types.ModuleType):
        def __setattr__(self, name: str, value: object) -> None:
            if name == "DISABLE_JIT" and value:
                tried.append(name)
            else:
                super().__setattr__(name, value)

    kind, numba.config.__class__ = type(numba.config), KeptOn
    try:
        yield tried
    finally:
        numba.config.__class__ = kind


def pecnut_solve(checkout: Path, positions: np.ndarray) -> Callable[[], object]:
    """The grand resistance matrix and its solve by a checkout of Pecnut/stokesian-dynamics, run from its own folder.

    Its settings switch numba off when they are imported, which made it slower by 60 to 100 times and stops mcdem's compiled
    code from being called; numba stays on here whatever they say, and so it is compared at its best.
    """
    import os

    folder = checkout / "stokesian_dynamics"
    for path in (checkout, folder):
        if str(path) not in sys.path:
            sys.path.insert(0, str(path))
    before, arguments = Path.cwd(), sys.argv
    os.chdir(folder)
    # Its settings read the command line when they are imported.
    sys.argv = ["run_simulation.py", "1", "1", "0.1", "1", "fte", "False"]
    try:
        with numba_kept_on() as switched_off:
            from functions.generate_grand_resistance_matrix import generate_grand_resistance_matrix  # type: ignore
    finally:
        os.chdir(before)
        sys.argv = arguments
    if switched_off and not _SAID:
        print("(the checkout's settings switch numba off; it is switched on for this comparison)", flush=True)
        _SAID.append(True)
    n = len(positions)
    none = np.zeros((0, 3))
    data = (np.ones(n), positions, np.zeros((n, 2, 3)), np.zeros(0), none, none)

    def solve() -> object:
        os.chdir(folder)
        try:
            resistance = generate_grand_resistance_matrix(data, None, regenerate_Minfinity=True)[0]
        finally:
            os.chdir(before)
        return np.linalg.solve(np.asarray(resistance), np.ones(len(positions) * 11))

    return solve


def encounters(run: Path, scene: mcdem.Scene, starts: int, seed: int) -> None:
    """Print the times of encounters under the default and under the paper's scheme, on the same starts."""
    given = scene.with_changes({"numerics.scheme": "implicit"})
    paper = given.with_changes(
        {"numerics.scheme": "explicit_euler", "numerics.explicit_euler.step_velocity": "normal"}
    )
    pairs = draw_pairs(scene, [run], starts, seed)
    warm_up(given, pairs[0])
    mcdem.simulate_encounter(paper.with_changes({"numerics.rotations": 0.01}), *pairs[0], seed=0)
    print(f"\nEncounters of {run.name} (population of its late snapshots), process time of one thread")
    print(f"{'primaries':>9} {'default, ms':>12} {'steps':>7} {'paper, ms':>12} {'steps':>8} {'ratio':>7}")
    ratios = []
    for k, pair in enumerate(pairs):
        results = [
            mcdem.simulate_encounter(s, *pair, seed=stream(seed, "performance", k)) for s in (given, paper)
        ]
        ratios.append(results[1].cpu_time / results[0].cpu_time)
        print(
            f"{sum(a.size for a in pair):9d} {1e3 * results[0].cpu_time:12.1f} {results[0].steps:7d} "
            f"{1e3 * results[1].cpu_time:12.0f} {results[1].steps:8d} {ratios[-1]:7.0f}  "
            f"{results[0].outcome}, {results[1].outcome}",
            flush=True,
        )
    print(
        f"median ratio {np.median(ratios):.0f} (quartiles {np.quantile(ratios, 0.25):.0f}, {np.quantile(ratios, 0.75):.0f})"
    )


def events(run: Path, scene: mcdem.Scene, count: int, seed: int) -> None:
    """Print what an encounter of the population costs under the default, by number of primaries, and what 283 s would."""
    opened = RunDataset(run)
    pairs = draw_pairs(scene, [run], count, seed)
    warm_up(scene, pairs[0])
    cpu = np.array(
        [
            mcdem.simulate_encounter(scene, *p, seed=stream(seed, "events", k)).cpu_time
            for k, p in enumerate(pairs)
        ]
    )
    size = np.array([a.size + b.size for a, b in pairs])
    print(f"\n{count} encounters of {run.name}, process time of one thread")
    for low, high in ((2, 6), (6, 12), (12, 24), (24, 48), (48, 10_000)):
        of = (size >= low) & (size < high)
        if of.any():
            print(
                f"  {low:3d} to {high - 1:4d} primaries: {of.mean():6.1%} of encounters, "
                f"{cpu[of].sum() / cpu.sum():6.1%} of time, "
                f"{1e3 * cpu[of].mean():7.1f} ms each"
            )
    print(
        f"  mean {1e3 * cpu.mean():.1f} +- {1e3 * cpu.std() / np.sqrt(count):.1f} ms, {1.0 / cpu.mean():.0f} a second"
    )
    late = opened.is_late
    times = opened.events["time"].values[late]
    rate = (len(times) - 1) / (times[-1] - times[0])
    print(
        f"  the late population meets {rate:.0f} times in a second of process time: 283 s are {283 * rate:.3g} encounters, "
        f"{283 * rate * cpu.mean() / 3600:.2f} h of CPU"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--run", type=Path, help="dataset of `mcdem run`, best with a steady population")
    parser.add_argument("--scene", help="scene whose numerics are timed, instead of those of the run")
    parser.add_argument(
        "--starts", type=int, default=20, help="encounters also followed by the paper's scheme"
    )
    parser.add_argument("--events", type=int, default=2000, help="encounters under the default alone")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pecnut", type=Path, help="checkout of Pecnut/stokesian-dynamics")
    parser.add_argument("--growth", action="store_true", help="also how solves and encounters grow with N")
    given = parser.parse_args()
    with threadpoolctl.threadpool_limits(limits=1):
        solves(given.pecnut)
    if given.growth:
        growth()
    with threadpoolctl.threadpool_limits(limits=1):
        if given.growth:
            growth_of_encounters()
        if given.run is not None:
            scene = mcdem.load_scene(given.scene) if given.scene else RunDataset(given.run).scene
            events(given.run, scene, given.events, given.seed)
            encounters(given.run, scene, given.starts, given.seed)


if __name__ == "__main__":
    main()
