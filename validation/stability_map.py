"""How long may a step be?  `python -m validation.stability_map` measures it and draws it beside what is predicted.

Three motions decide: a stiff contact that relaxes, the snap-in of two primaries by van der Waals attraction, and a cluster
that turns.  Each is followed by the paper's explicit scheme and by the implicit one, at steps that are bisected between one
that holds and one that fails, against elastic modulus, cut-off and viscosity, one at a time about the paper's scene at 1000 Pa.

The table is kept in `data/stability_map.json` with the command that made it; `validation.cases.stability_of_steps` puts it
into the report and measures some of it anew.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from mcdem.analysis.dimensionless_groups import contact_relaxation
from mcdem.effects.sums import contact_equilibrium, contact_force, contact_gap, contact_pull_off_force
from mcdem.effects.van_der_waals import VanDerWaalsKernel
from mcdem.encounter.motion import analysed
from mcdem.encounter.simulate import physics_of
from mcdem.figures.style import BLACK, BLUE, GREY, ORANGE, VERMILION, canvas, look
from mcdem.integrators import SCHEMES, state
from mcdem.rigid_aggregates.statics import worst_load
from mcdem.scene import Scene, load_scene
from validation.hard_cases import laws
from validation.hard_cases.case import PAPER
from validation.hard_cases.shapes import settled
from validation.hard_cases.watch import Start, Watched, watch

KEPT = Path(__file__).parent / "data" / "stability_map.json"
COMMAND = "python -m validation.stability_map"

LONGEST = 1.0
"""Longest step that is tried, in strain; twice what is predicted for explicit Euler if that is longer."""
SHORTEST = 0.2
"""Shortest step that is tried, over what is predicted for explicit Euler."""
RESOLUTION = 1.03
"""Ratio of the shortest step seen to fail to the longest seen to hold."""
PAPERS_STEP = 1e-6
"""dt_b [s] of Table 1."""


class Sweep(NamedTuple):
    """A parameter that is varied."""

    key: str
    unit: str
    values: tuple[float, ...]
    label: str
    shear_rate: float = 1e4
    """[1/s]"""

    def at(self, base: Scene, value: float) -> Scene:
        """The scene with this value."""
        given = f"{value!r} {self.unit}" if self.unit else value
        # The frozen matrix would squeeze contacts that overlap by more than the cut-off: not a matter of steps.
        return base.with_changes(
            {
                "hydrodynamics.cutoff_convention": "gap",
                "flow.shear_rate": f"{self.shear_rate!r} 1/s",
                self.key: given,
            }
        )


SWEEPS = {
    "elastic_modulus": Sweep(
        "effects.jkr.elastic_modulus",
        "Pa",
        (1e7, 1e8, 1e9, 3.4e9, 1e10, 1e11, 1e12),
        "elastic modulus $E$ [Pa]",
    ),
    "cutoff": Sweep(
        "hydrodynamics.lubrication_cutoff", "", (1e-3, 2e-3, 5e-3, 1e-2, 3e-2, 1e-1), "cut-off $\\delta$ [a]"
    ),
    # So slow that the most viscous fluid exerts the paper's 1000 Pa: contacts hold in all of them.
    "viscosity": Sweep(
        "flow.viscosity", "Pa s", (1e-3, 1e-2, 0.1, 1.0, 10.0), "viscosity $\\mu$ [Pa s]", shear_rate=100.0
    ),
}


class Scheme(NamedTuple):
    """A scheme whose step is varied."""

    words: str
    scheme: str
    in_seconds: bool
    """Whether the step is a key in seconds, not in strain."""
    changes: dict[str, object] | None = None

    def at(self, scene: Scene, step: float) -> Scene:
        """The scene followed by steps of `step`, in strain."""
        key = f"numerics.{self.scheme}.{SCHEMES[self.scheme].step_key}"
        given = f"{step / scene.flow.shear_rate!r} s" if self.in_seconds else step
        return scene.with_changes({"numerics.scheme": self.scheme, **(self.changes or {}), key: given})


WAYS = {
    "euler": Scheme("explicit Euler", "explicit_euler", True, {"numerics.explicit_euler.close_gap": 1e-12}),
    "paper": Scheme("explicit Euler with Eq. 20", "explicit_euler", True),
    "implicit": Scheme("implicit", "implicit", False),
}


# The motions, and when a step is short enough for them


def attraction(scene: Scene) -> VanDerWaalsKernel:
    """The scene's van der Waals attraction, in reduced units."""
    law: VanDerWaalsKernel = next(p for p in scene.kernels.pair_forces if isinstance(p, VanDerWaalsKernel))
    return law


def pair(scene: Scene, gap: float, bonded: bool) -> Start:
    """Two primaries along the vorticity, where the flow turns them but does not pull: `gap` [a] apart."""
    half = 0.5 * (2.0 + gap) * scene.suspension.radius
    contact = np.array([[False, bonded], [bonded, False]])
    return Start(np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]]), contact, np.array([0, 1]))


def gap_of(seen: Watched) -> float:
    """Gap [a] of two primaries at the end."""
    return float(np.linalg.norm(seen.positions[1] - seen.positions[0])) - 2.0


def contact_holds(scene: Scene, step: float) -> bool:
    """A contact a hundredth of its overlap away from rest is no further away after 40 steps."""
    _, physics = physics_of(scene)
    rest, _ = contact_equilibrium(1.0, physics.contact)
    seen = watch(scene, pair(scene, 0.99 * rest, True), 40.0 * step)
    return seen.code == state.DONE and bool(seen.bonded[0, 1]) and abs(gap_of(seen) / rest - 1.0) <= 0.0101


def snap_in_holds(scene: Scene, step: float) -> bool:
    """Two primaries at about 3 l0 land on each other no deeper than their contact bears the attraction, and come to rest.

    Five starts a tenth of l0 apart, since it matters where on the way the steps happen to fall.
    """
    pull = attraction(scene)
    _, physics = physics_of(scene)
    rest, _ = contact_equilibrium(1.0, physics.contact)
    unit = pull.minimum_approach
    # Falling from 3 l0 takes (4^3 - 1)/3 = 21 times as long as closing l0 at contact.
    fall = 42.0 * unit / (pull_at_contact(scene) * mobility(scene, 0.0))
    for place in range(5):
        seen = watch(scene, pair(scene, (3.0 + 0.1 * place) * unit, False), fall + 100.0 * step)
        landed = seen.code == state.DONE and bool(seen.bonded[0, 1]) and -seen.deepest <= landing_depth(scene)
        if not landed or abs(gap_of(seen) / rest - 1.0) > 0.1:
            return False
    return True


def cluster(scene: Scene) -> Start:
    """An octahedron, isostatic, as it stands in the flow."""
    corners = np.sqrt(2.0) * np.vstack([np.eye(3), -np.eye(3)])
    aggregate = settled(scene, corners, 3)
    return Start(aggregate.positions, aggregate.contact_network(), np.zeros(aggregate.size, np.int64))


def turning_holds(scene: Scene, step: float) -> bool:
    """A cluster that turns keeps its contacts within three times what they bear at the worst orientation.

    For a radian or 400 steps, whichever is shorter, but 20 at least.
    """
    start = cluster(scene)
    flow, physics = physics_of(scene)
    n = len(start.parent)
    at = start.positions / scene.suspension.radius
    still = state.Motion(at, np.zeros((n, 3)), start.bonded, np.zeros((n, n)), np.ones(n), start.parent)
    body, _ = analysed(still, physics)
    assert body is not None
    load = 3.0 * worst_load(body, flow.strain_five)
    strength = contact_pull_off_force(1.0, physics.contact)
    longest = contact_gap(-min(load, 0.999) * strength, 1.0, physics.contact)
    shortest = contact_gap(load * strength, 1.0, physics.contact)
    seen = watch(scene, start, max(min(2.0, 400.0 * step), 20.0 * step))
    sound = seen.code == state.DONE and seen.finite and seen.changes == 0
    return sound and seen.kept_to <= longest and seen.deepest >= shortest


# What is predicted for explicit Euler, in strain


def mobility(scene: Scene, gap: float) -> float:
    """Rate of the gap under a unit force that pushes two spheres apart; reduced units."""
    matrix = laws.resistance(scene, np.array([[-1.0 - 0.5 * gap, 0.0, 0.0], [1.0 + 0.5 * gap, 0.0, 0.0]]))
    force = np.zeros(12)
    force[6], force[9] = -1.0, 1.0
    rates = np.linalg.solve(matrix, force)
    return float(rates[9] - rates[6])


def predicted_contact(scene: Scene, load: float = 0.0) -> float:
    """2/(k m): Euler's limit for the relaxation of a contact of stiffness k, with the mobility m of two spheres.

    load : compression of the contact over its pull-off force
    """
    _, physics = physics_of(scene)
    strength = contact_pull_off_force(1.0, physics.contact)
    gap = contact_gap(load * strength, 1.0, physics.contact)
    _, slope = contact_force(gap, 1.0, physics.contact)
    return 2.0 / (-slope * mobility(scene, gap))


def pull_at_contact(scene: Scene) -> float:
    """Attraction of two primaries that touch; reduced units."""
    pull = attraction(scene)
    return pull.strength / pull.minimum_approach**2


def landing_depth(scene: Scene) -> float:
    """Overlap [a] of a contact that bears the attraction of two primaries that touch."""
    return laws.depth(scene, 1.0 + pull_at_contact(scene))


def predicted_snap_in(scene: Scene) -> float:
    """The shorter of the contact's own limit and the time in which the attraction closes all of the depth allowed."""
    fall = landing_depth(scene) / (pull_at_contact(scene) * mobility(scene, 0.0))
    return min(fall, predicted_contact(scene))


def predicted_turning(scene: Scene) -> float:
    """Euler's limit for the stiffest motion of the cluster: 2 over the largest eigenvalue of mobility times stiffness."""
    start = cluster(scene)
    positions = start.positions / scene.suspension.radius
    n = len(positions)
    _, physics = physics_of(scene)
    _, stiffness = contact_equilibrium(1.0, physics.contact)
    springs: NDArray[np.floating] = np.zeros((3 * n, 3 * n))
    for i, j in np.argwhere(np.triu(start.bonded)):
        apart = positions[i] - positions[j]
        row = np.zeros(3 * n)
        row[3 * i : 3 * i + 3] = apart / np.linalg.norm(apart)
        row[3 * j : 3 * j + 3] = -row[3 * i : 3 * i + 3]
        springs += stiffness * np.outer(row, row)
    inverse: NDArray[np.floating] = np.linalg.inv(laws.resistance(scene, positions))[3 * n :, 3 * n :]
    return 2.0 / float(np.linalg.eigvals(inverse @ springs).real.max())


class Motion(NamedTuple):
    """A motion that bounds the step."""

    words: str
    holds: Callable[[Scene, float], bool]
    predicted: Callable[[Scene], float]
    schemes: tuple[str, ...]
    """Eq. 20 is about pairs that are not in contact."""


MOTIONS = {
    "contact": Motion("relaxation of a contact", contact_holds, predicted_contact, ("euler", "implicit")),
    "snap_in": Motion("snap-in by attraction", snap_in_holds, predicted_snap_in, ("euler", "paper", "implicit")),
    "turning": Motion("a turning octahedron", turning_holds, predicted_turning, ("euler", "implicit")),
}  # fmt: skip


# Measuring


def largest_step(holds: Callable[[float], bool], shortest: float, longest: float) -> tuple[float, bool]:
    """(largest step that holds, whether a longer one was seen to fail) to `RESOLUTION`; nan if the shortest fails."""
    if holds(longest):
        return longest, False
    if not holds(shortest):
        return math.nan, True
    low, high = shortest, longest
    while high > RESOLUTION * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, True


Row = dict[str, Any]


def measure_point(motion: str, sweep: str, value: float, base: Scene | None = None) -> list[Row]:
    """A row for each scheme: the largest step that holds [s] and what is predicted, at one value of one parameter."""
    what = MOTIONS[motion]
    scene = SWEEPS[sweep].at(base or load_scene(PAPER), value)
    second = 1.0 / scene.flow.shear_rate
    limit = what.predicted(scene)
    rows = []
    for name in what.schemes:

        def holds(step: float, scheme: Scheme = WAYS[name]) -> bool:
            return what.holds(scheme.at(scene, step), step)

        step, fails = largest_step(holds, SHORTEST * limit, max(LONGEST, 2.0 * limit))
        rows.append(
            {
                "motion": motion,
                "parameter": sweep,
                "value": value,
                "scheme": name,
                "largest_step": step * second if math.isfinite(step) else None,
                "longer_fails": fails,
                "predicted_for_euler": limit * second,
                "twice_relaxation_time": 2.0 * contact_relaxation(scene),
            }
        )
    return rows


def measure(progress: Callable[[str], None] = lambda words: None) -> list[Row]:
    """The whole map."""
    rows: list[Row] = []
    for motion in MOTIONS:
        for name, sweep in SWEEPS.items():
            for value in sweep.values:
                progress(f"{motion} {name} = {value:g}")
                rows += measure_point(motion, name, value)
    return rows


def kept() -> list[Row]:
    """The map as it was last measured."""
    rows: list[Row] = json.loads(KEPT.read_text(encoding="utf-8"))["rows"]
    return rows


# Reading and drawing


def of(rows: Sequence[Row], **wanted: Any) -> list[Row]:
    """The rows with these entries."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def steps_of(rows: Sequence[Row]) -> NDArray[np.float64]:
    """Largest steps [s]; nan where none of those tried holds."""
    return np.array([math.nan if row["largest_step"] is None else row["largest_step"] for row in rows])


def crossing(rows: Sequence[Row], parameter: str, scheme: str = "euler") -> float:
    """Value of a parameter at which the scheme's largest step, the least over the motions, is dt_b = 1 us; nan if nowhere.

    Straight lines between the logarithms of what was measured.
    """
    here = [row for row in of(rows, parameter=parameter, scheme=scheme) if row["largest_step"] is not None]
    values = sorted({row["value"] for row in here})
    steps = [min(row["largest_step"] for row in of(here, value=value)) for value in values]
    excess = np.log(np.array(steps) / PAPERS_STEP)
    for k in range(len(values) - 1):
        if excess[k] * excess[k + 1] <= 0.0:
            share = excess[k] / (excess[k] - excess[k + 1])
            return float(values[k] ** (1.0 - share) * values[k + 1] ** share)
    return math.nan


LOOKS = {"euler": (VERMILION, "o", 3), "paper": (ORANGE, "s", 6), "implicit": (BLUE, "^", 4)}
"""Colour, marker and its size; the small one is drawn upon the large one."""


def draw(rows: Sequence[Row]) -> Canvas:
    """A row of panels a motion, a column a parameter; filled where a longer step fails, hollow where the longest tried holds."""
    figure, panels = canvas(7.0, 6.6, nrows=len(MOTIONS), ncols=len(SWEEPS), sharey=True, sharex="col")
    handles: dict[str, Any] = {}
    for line, (name, motion) in zip(panels, MOTIONS.items(), strict=True):
        for axes, parameter in zip(line, SWEEPS, strict=True):
            here = of(rows, motion=name, parameter=parameter)
            first = of(here, scheme=motion.schemes[0])
            x = [row["value"] for row in first]
            for key, style, words in (
                ("predicted_for_euler", "-", "predicted for explicit Euler"),
                ("twice_relaxation_time", ":", "twice the relaxation time of a contact"),
            ):
                (handles[words],) = axes.loglog(x, [row[key] for row in first], style, color=BLACK)
            for scheme in sorted(motion.schemes, key=lambda name: -LOOKS[name][2]):
                colour, marker, size = LOOKS[scheme]
                found = of(here, scheme=scheme)
                values = np.array([row["value"] for row in found])
                steps = steps_of(found)
                fails = np.array([row["longer_fails"] for row in found])
                axes.loglog(values, steps, marker, ms=size, color=colour, mfc="none")
                axes.loglog(values[fails], steps[fails], marker, ms=size, color=colour)
                handles[WAYS[scheme].words] = axes.plot([], [], marker, ms=size, color=colour)[0]
            handles["$dt_b$ of Table 1"] = axes.axhline(PAPERS_STEP, color=GREY, lw=0.8, ls="--")
        line[0].set_ylabel(f"largest step [s]\n{motion.words}")
    for axes, sweep in zip(panels[-1], SWEEPS.values(), strict=True):
        axes.set_xlabel(sweep.label)
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=3)
    return figure


CAPTION = (
    "Largest step that holds, measured (filled: a longer one fails; hollow: the longest tried holds), and Euler's limit as "
    "predicted; the paper's scene at 1000 Pa with one parameter varied, viscosity at 100 1/s. Where a step at that "
    "limit would turn bonds by more than a few hundredths, their stretch limits explicit steps first."
)


def main(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the figure.")] = Path("stability-map"),
    draw_only: Annotated[bool, typer.Option("--draw", help="Draw what is kept, measure nothing.")] = False,
) -> None:
    """Measure the stability map, keep it, and draw it."""
    if not draw_only:
        rows = measure(partial(print, flush=True))
        table = ",\n  ".join(json.dumps(row) for row in rows)
        KEPT.write_text(f'{{"command": "{COMMAND}",\n "rows": [\n  {table}\n]}}\n', encoding="utf-8")
    out.mkdir(parents=True, exist_ok=True)
    with look():
        draw(kept()).savefig(out / "stability_map.png", dpi=200)
    print(CAPTION)
    for name, sweep in SWEEPS.items():
        print(f"dt_b = 1 us is Euler's limit at {name} = {crossing(kept(), name):.3g} {sweep.unit}")


if __name__ == "__main__":
    typer.run(main)
