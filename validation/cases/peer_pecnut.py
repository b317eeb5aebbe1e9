"""Velocities of free spheres in shear beside those of Pecnut/stokesian-dynamics (Townsend), whose strain has the wrong sign.

    python -m validation.cases.peer_pecnut CHECKOUT > validation/data/pecnut.json

runs a checkout and keeps its numbers; `--pecnut CHECKOUT` runs one instead of reading them.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np

from mcdem.figures.style import BLUE, GREY, VERMILION, canvas, legend
from validation import datasets
from validation.case import Case, Context, Findings, below, near, shown

KEPT = Path(__file__).parent.parent / "data" / "pecnut.json"
GAPS = (3e-3, 0.035, 0.1, 0.3, 1.0, 2.0)
"""Gaps of two spheres on the extension axis; its table is coarse near the first two."""
PUBLISHED_A3 = 0.1866626
"""A(3) of Batchelor & Green 1972."""

RUN = """
import json, os, sys
sys.path.insert(0, os.getcwd())
sys.argv = sys.argv[:1]
import numpy as np
from functions.generate_grand_resistance_matrix import generate_grand_resistance_matrix
from functions.simulation_tools import (
    construct_force_vector_from_fts, deconstruct_velocity_vector_for_fts, fts_to_fte_matrix,
)
spin, strain = np.array([0.5, 0, 0]) * -1.0, np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0]])
answers = []
for x in json.load(sys.stdin):
    x = np.array(x, float)
    n = len(x)
    spheres = (np.ones(n), x, np.zeros((n, 2, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    resistance = generate_grand_resistance_matrix(spheres, None, (True, False), cutoff_factor=2)[0]
    still = [[0, 0, 0]] * n
    both = []
    for sign in (1, -1):
        load = construct_force_vector_from_fts(spheres, still, still, [sign * strain] * n, [], [])
        rates = np.linalg.solve(fts_to_fte_matrix(spheres, resistance), np.array(load, float))
        relative = np.array(deconstruct_velocity_vector_for_fts(spheres, rates)[0], float)
        both.append((relative - np.cross(spin, x) + x @ strain).tolist())
    answers.append(both)
json.dump(answers, sys.stdout)
"""
"""Within the checkout: velocities (spheres, 3) as it solves its shear, with the strain as given, and with its sign turned."""


def configurations():
    """Positions (N, 3) [a]: pairs on the extension axis, then eight spheres at random, no gap below half a radius."""
    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2.0)
    pairs = [[[0.0, 0.0, 0.0], ((2.0 + gap) * n).tolist()] for gap in (*GAPS, 1.0)]
    rng, placed = np.random.default_rng(8), []
    while len(placed) < 8:
        new = 7.0 * rng.random(3)
        if all(np.linalg.norm(new - p) > 2.5 for p in placed):
            placed.append(new)
    return [*pairs, np.array(placed).tolist()]


def theirs(checkout: Path):
    """Velocities of every configuration, as shipped and with the sign of the strain turned."""
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        input=json.dumps(configurations()),
        capture_output=True,
        text=True,
        cwd=checkout / "stokesian_dynamics",
        timeout=600,
        check=True,
    )
    return json.loads(done.stdout[done.stdout.index("[[[") :])


def ours():
    """Velocities of every configuration, full lubrication, in a g."""
    import mcdem
    from validation.exact.settling import scene

    asked = scene()
    units = asked.reduced
    return [
        (mcdem.velocities(asked, np.array(x) * units.length).linear / units.velocity).tolist()
        for x in configurations()
    ]


def measure(context: Context):
    checkout = context.given.pecnut
    peer = theirs(checkout) if checkout else json.loads(KEPT.read_text(encoding="utf-8"))["velocities"]
    return {"ours": ours(), "theirs": peer}


def judge(context: Context, found):
    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2.0)

    def parting(velocities):
        return float(np.diff(np.array(velocities), axis=0)[0] @ n)

    mine = np.array([parting(v) for v in found["ours"][: len(GAPS)]])
    shipped, turned = (np.array([parting(v[k]) for v in found["theirs"][: len(GAPS)]]) for k in (0, 1))
    middle = GAPS.index(1.0)
    spheres = np.array(found["ours"][-1])
    peer = np.array(found["theirs"][-1][1])
    flow = np.array(configurations()[-1])[:, [1]] * [0.0, 0.0, 1.0]
    off = np.abs(peer - spheres).max() / np.abs(spheres - flow).max()
    wrong = np.abs(np.array(found["theirs"][-1][0]) - spheres).max() / np.abs(spheres - flow).max()
    said = "parting of a pair at r = 3 a on the extension axis"
    checks = [
        near(f"{said}, ours", mine[middle], 1.5 * (1 - PUBLISHED_A3), abs=1e-4, unit="g a"),
        near(f"{said}, theirs as shipped: 1.5 (1 + A), the sign of the strain is wrong", shipped[middle],
             1.5 * (1 + PUBLISHED_A3), abs=2e-3, unit="g a"),
        near(f"{said}, theirs with the sign turned", turned[middle], 1.5 * (1 - PUBLISHED_A3), abs=2e-3, unit="g a"),
        below("eight spheres: largest difference with the sign turned, over the largest disturbance", off, 0.02),
        shown("eight spheres: the same as shipped", wrong),
    ]  # fmt: skip
    for gap, a, b in zip(GAPS, mine, turned):
        checks.append(shown(f"pair at a gap of {gap:g} a: theirs with the sign turned, over ours", b / a))

    def draw():
        figure, axes = canvas(width=4.5, height=2.8)
        axes.semilogx(GAPS, mine, "-", color=BLUE, label="mcdem")
        axes.semilogx(
            GAPS, turned, "o", mfc="none", ms=4, color=GREY, label="peer, sign of the strain turned"
        )
        axes.semilogx(GAPS, shipped, "s--", ms=4, color=VERMILION, label="peer as shipped")
        axes.set(xlabel="gap / a", ylabel="parting on the extension axis (g a)")
        legend(axes)
        return figure

    return Findings(tuple(checks), draw, "Two free spheres on the extension axis of the shear.")


CASE = Case(
    chapter=9,
    claim="Velocities in shear are those of Pecnut/stokesian-dynamics once the sign of its strain is turned; as shipped it "
    "drives a pair on the extension axis apart faster than the flow does.",
    source="github.com/Pecnut/stokesian-dynamics, commit 6b9117d; Batchelor & Green 1972",
    tolerance="2e-3 a g at r = 3 a, 2 % of the disturbance for eight spheres at gaps from 0.5 a: its near field "
    "is interpolated linearly",
    measure=measure,
    judge=judge,
    inputs=lambda context: datasets.checkout(context) or (KEPT,),
    saved=lambda context: () if datasets.checkout(context) else (KEPT,),
    anew="our velocities; with --pecnut CHECKOUT, the peer's",
    seen=("strain_sign", "no_lubrication"),
)


if __name__ == "__main__":
    where = Path(sys.argv[1])
    git = ["git", "-C", str(where), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    print(json.dumps({"commit": commit, "velocities": theirs(where)}))
