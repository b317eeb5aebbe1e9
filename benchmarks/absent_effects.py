"""What an effect costs that a scene does not name: nothing, to round-off and to 2 % of a step.

For each direct force, contact law and resistance of contacts, with the same primaries and the rest of the scene as it is:

    zero     largest change of the velocities between the effect absent (None) and present with strength zero
    scene    the same change for the strength that the scene gives, to show that the effect acts on these primaries
    step     processor time of a step with the effect absent
    absent   that time over the one of a build whose sources never had the effect
    added    processor time that the effect adds to a step when present
    present  time of a step with the effect present, over absent

The build that never had it is a copy of the package without the file of the effect and its line in the menu; it
runs in a process of its own, and moves the primaries alike to the last bit.  The builds take turns of a few milliseconds; in
each round every build's fastest turn counts, since what else runs on the machine can only add to it, and a pair of processes
gives the median over its rounds.  The table has the mean over several pairs of processes, with its standard error.  Steps
are those of the explicit scheme with free draining, in which direct forces are most of the work: a share of a Stokesian step
is smaller.

Resistances of contacts (sliding, rolling, twisting, rods) are followed by the implicit scheme alone and timed with it.  Present,
they double the unknowns, since spheres then turn against torques: zero strength and absence are then two Newton iterations for
one root, each ended by its own tolerance.  That they have the same root is shown by builds that iterate until a move is below
TO_THE_END: rounding of a gap, 4e-16 a, times the stiffness of a contact over the drag of a step, is some 1e-13 a.
What they change is measured with the Rotne-Prager level, since torques move no centre in free draining, and from contacts under
load, since free spheres in shear spin alike.
`--level`, `--scheme` and `--effects` choose others; each pair of builds then compiles for minutes.

    python benchmarks/absent_effects.py --save validation/data/absent_effects.csv > benchmarks/absent_effects.md
"""

from __future__ import annotations

import argparse
import ast
import csv
import io
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent
PRIMARIES = 24
PAPER = ROOT / "scenes" / "paper-1000Pa.toml"
# Table of each effect, and the tables of the paper's scene that have to go for it.
EFFECTS = {
    "van_der_waals": ({"hamaker_constant": "0.97e-20 J", "minimum_approach": "0.165 nm"}, ()),
    "double_layer": (
        {
            "surface_potential": "-25 mV",
            "debye_length": "10 nm",
            "relative_permittivity": 78.5,
            "condition": "constant_potential",
        },
        (),
    ),
    "born": ({"collision_diameter": "0.5 nm"}, ("jkr",)),
    "steric": ({"brush_thickness": "10 nm", "grafting_distance": "3 nm", "temperature": "298 K"}, ("jkr",)),
    "jkr": ({"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}, ()),
    "dmt": ({"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}, ("jkr",)),
    "sliding": ({"friction_coefficient": 0.3}, ()),
    "rolling": ({"critical_displacement": "0.5 nm"}, ()),
    "twisting": ({"friction_coefficient": 0.3}, ()),
    "rods": ({"stiffness": "5 N/m", "largest_displacement": "2 nm"}, ()),
}
RESISTANCES = ("sliding", "rolling", "twisting", "rods")
# Where Newton's method ends, in a: file of the package, and the line that says so.
TO_THE_END = 1e-12
TOLERANCES = {
    "integrators/newton.py": ("CONVERGED = 1e-7", f"CONVERGED = {TO_THE_END}"),
    "integrators/contact_torques.py": ("SETTLED = 1e-8", f"SETTLED = {TO_THE_END}"),
}
TURNS, TURN = 6, 8e-3  # turns of a build in a round, and their processor time [s]
# The field of each kernel that holds its strength.
STRENGTH = {
    "van_der_waals": "strength",
    "double_layer": "strength",
    "born": "strength",
    "steric": "pressure",
    "jkr": "pull_off_force",
    "dmt": "pull_off_force modulus",
    **dict.fromkeys(RESISTANCES, "stiffness"),
}


# The worker: times steps of one scene with the package that PYTHONPATH names.


def scene_of(effect: str, present: bool, scheme: str, level: str):
    """The paper's scene with or without an effect, and without what cannot stand beside it."""
    import mcdem
    from mcdem.hydrodynamics import LEVELS

    table, away = EFFECTS[effect]
    changes: dict[str, object] = {f"effects.{name}": None for name in away}
    changes[f"effects.{effect}"] = dict(table) if present else None
    changes |= {"numerics.scheme": scheme, "hydrodynamics.level": level}
    if not LEVELS[level].lubrication:
        changes["hydrodynamics.lubrication_cutoff"] = None
    return mcdem.load_scene(PAPER).with_changes(changes)


LOADED = 1e-4  # springs that contacts start with, in a, and their twist


def primaries(contacts: bool):
    """A loose cluster with contacts a little compressed, or gaps of 0.5 nm, and neighbours up to a radius off.

    Positions (N, 3), contacts (N, N), springs (N, N, 7) of a contact's sliding, rolling and twisting.
    """
    import numpy as np

    rng = np.random.default_rng(5)
    positions, bonds = [np.zeros(3)], []
    while len(positions) < PRIMARIES:
        i = int(rng.integers(len(positions)))
        direction = rng.normal(size=3)
        trial = positions[i] + (2.0 - 3e-4 if contacts else 2.001) * direction / np.linalg.norm(direction)
        if all(np.linalg.norm(trial - p) > 2.0005 for k, p in enumerate(positions) if k != i):
            bonds.append((len(positions), i))
            positions.append(trial)
    bonded = np.zeros((PRIMARIES, PRIMARIES), bool)
    springs = np.zeros((PRIMARIES, PRIMARIES, 7))
    for i, j in bonds if contacts else ():
        bonded[i, j] = bonded[j, i] = True
        normal = (positions[i] - positions[j]) / np.linalg.norm(positions[i] - positions[j])
        across = rng.normal(size=(2, 3))
        across -= np.outer(across @ normal, normal)
        springs[i, j] = LOADED * np.append(across.ravel(), rng.normal())
    return np.array(positions), bonded, springs


class Steps:
    """Steps of one scene from the same start, again and again."""

    def __init__(self, scene, zeroed: str = "", contacts: bool = True):
        from mcdem.encounter import simulate as encounter

        self.flow, self.physics = encounter.physics_of(scene)
        if zeroed:
            self.physics = without_strength(self.physics, zeroed)
        self.options = encounter.options_of(scene)
        self.resisting = scene.effects.resisting
        self.start, self.bonded, self.springs = primaries(contacts)

    def run(self, steps: int):
        """(velocities (N, 3) of the last step, processor time of a step [s], strain at its end)."""
        import numpy as np

        from mcdem.integrators import state
        from mcdem.integrators.pairs import find_gaps
        from mcdem.integrators.scheme import scheme_of
        from mcdem.integrators.time_loop import Bounds, follow_steps, new_watch

        n = PRIMARIES
        motion = state.Motion(
            self.start.copy(),
            np.zeros((n, 3)),
            self.bonded.copy(),
            np.full((n, n), -np.inf),
            np.ones(n),
            np.zeros(n, np.int64),
            self.springs.copy() if self.resisting else None,
        )
        log, history, gaps = state.new_log(), state.new_history(motion), np.empty((n, n))
        work = scheme_of(self.options).workspace(n, self.resisting)
        find_gaps(motion.positions, motion.radii, gaps)
        group, watch = state.Group(motion, history, gaps, work), new_watch(log, np.inf)
        bounds = Bounds(0.0, np.inf, np.inf, 1e9, steps)
        began = time.process_time()
        code = follow_steps(group, self.flow, self.physics, self.options, log, watch, bounds)
        spent = time.process_time() - began
        assert code == state.TOO_MANY_STEPS, code
        return motion.velocities, spent / steps, log.time[0]


def without_strength(physics, effect: str):
    """The same physics with the strength of one effect zero."""
    from mcdem import effects

    kind, zeros = effects.EFFECTS[effect].kernel, dict.fromkeys(STRENGTH[effect].split(), 0.0)

    def weak(law):
        return law._replace(**zeros) if isinstance(law, kind) else law

    return physics._replace(
        pair_forces=tuple(map(weak, physics.pair_forces)),
        contact=weak(physics.contact),
        resistances=tuple(map(weak, physics.resistances)),
    )


def work(effect: str, scheme: str, level: str) -> None:
    """Answer requests "absent N", "present N", "zero 1" by lines of JSON: [processor time of a step, velocities, strain]."""
    known: dict[str, Steps] = {}
    for line in sys.stdin:
        which, steps = line.split()
        if which not in known:
            scene = scene_of(effect, which != "absent", scheme, level)
            known[which] = Steps(scene, effect if which == "zero" else "", effect not in ("born", "steric"))
            known[which].run(1)
        velocities, spent, strain = known[which].run(int(steps))
        print(json.dumps([spent, velocities.tolist(), strain]), flush=True)


# The parent: builds, workers, table.


class Cut(ast.NodeTransformer):
    """Removes every `if springs is not None:`, and what follows torques, for a build that has no resistance."""

    names = frozenset({"springs", "torques"})
    count = 0

    def visit_If(self, node: ast.If):
        self.generic_visit(node)
        test = node.test
        if (
            isinstance(test, ast.Compare)
            and isinstance(test.left, ast.Name)
            and test.left.id in self.names
            and isinstance(test.ops[0], ast.IsNot)
        ):
            self.count += 1
            return node.orelse or None
        return node


def build_without(effect: str, folder: Path) -> Path:
    """A copy of the package that never heard of an effect, for a resistance of any; returns its parent folder."""
    shutil.copytree(ROOT / "mcdem", folder / "mcdem", ignore=shutil.ignore_patterns("__pycache__"))
    package = folder / "mcdem"
    menu = package / "effects" / "__init__.py"
    for name in RESISTANCES if effect in RESISTANCES else (effect,):
        (package / "effects" / f"{name}.py").unlink()
        source = menu.read_text()
        if source.count(f'    "{name}",\n') != 1:
            raise SystemExit(f"{effect}: expected a line of its own in the menu of mcdem/effects")
        menu.write_text(source.replace(f'    "{name}",\n', ""))
    if effect in RESISTANCES:
        count = 0
        for name in ("implicit_midpoint.py", "state.py"):
            path, cut = package / "integrators" / name, Cut()
            tree = cut.visit(ast.parse(path.read_text()))
            for node in ast.walk(tree):
                # What is left of a function that held nothing else.
                if isinstance(node, ast.FunctionDef) and not node.body[bool(ast.get_docstring(node)) :]:
                    node.body.append(ast.Pass())
            path.write_text(ast.unparse(ast.fix_missing_locations(tree)))
            count += cut.count
        if count == 0:
            raise SystemExit(f"{effect}: no branch on springs was found in mcdem/integrators")
    return folder


def build_to_the_end(folder: Path) -> Path:
    """A copy of the package whose iterations end at round-off; returns its parent folder."""
    shutil.copytree(ROOT / "mcdem", folder / "mcdem", ignore=shutil.ignore_patterns("__pycache__"))
    for name, (given, wanted) in TOLERANCES.items():
        path = folder / "mcdem" / name
        source = path.read_text()
        if source.count(given) != 1:
            raise SystemExit(f"{name}: expected {given!r} once")
        path.write_text(source.replace(given, wanted))
    return folder


class Worker:
    """A process that times steps with one build."""

    def __init__(self, build: Path, arguments: list[str]):
        environment = os.environ | {"PYTHONPATH": str(build), "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--worker", *arguments],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )

    def ask(self, which: str, steps: int):
        """(processor time of a step [s], velocities (N, 3), strain at its end)."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(f"{which} {steps}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"the worker for {which} ended with code {self.process.wait()}")
        return json.loads(answer)

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def largest_change(one, other) -> float:
    """Largest difference of two lists of vectors over the largest component."""
    pairs = [(a, b) for u, v in zip(one, other, strict=True) for a, b in zip(u, v, strict=True)]
    return max(abs(a - b) for a, b in pairs) / max(abs(a) for a, _ in pairs)


def zero_to_the_end(arguments: list[str], build: Path) -> float:
    """Change of the velocities between an effect absent and of strength zero, where iterations end at round-off."""
    worker = Worker(build, arguments)
    try:
        (_, absent, strain), (_, zero, other) = worker.ask("absent", 1), worker.ask("zero", 1)
        if strain != other:
            raise SystemExit("iterated to the end, a step is not taken at its full length")
        return largest_change(absent, zero)
    finally:
        worker.close()


def take_turns(whole: Worker, cut: Worker, rounds: int, shifted: int) -> dict[str, float]:
    """Times of a step [s] with the effect absent and their ratios, medians over the rounds of one pair of processes."""
    turns = [("absent", whole, "absent"), ("never", cut, "absent"), ("present", whole, "present")]
    for _, worker, which in turns:
        worker.ask(which, 1)  # compiles
    # As many steps for each, since what a step costs changes on the way; where they take long, in fewer turns.
    first = {name: worker.ask(which, 20)[0] for name, worker, which in turns}
    steps = max(1, round(TURN / first["absent"]))
    allowed = {name: max(1, round(TURNS * first["absent"] / first[name])) for name in first}
    times: dict[str, list[float]] = {name: [] for name, _, _ in turns}
    for number in range(rounds):
        fastest = dict.fromkeys(times, float("inf"))
        for turn in range(TURNS):
            shift = (shifted + number + turn) % 3
            for name, worker, which in turns[shift:] + turns[:shift]:
                if turn < allowed[name]:
                    fastest[name] = min(fastest[name], worker.ask(which, steps)[0])
        for name, value in fastest.items():
            times[name].append(value)
    absent, never, present = times["absent"], times["never"], times["present"]
    return {
        "step": statistics.median(absent),
        "absent": statistics.median(a / n for a, n in zip(absent, never, strict=True)),
        "added": statistics.median(p - a for p, a in zip(present, absent, strict=True)),
        "present": statistics.median(p / a for p, a in zip(present, absent, strict=True)),
    }


def scheme_for(effect: str, options: argparse.Namespace) -> str:
    """The scheme whose steps are timed."""
    return "implicit" if effect in RESISTANCES else str(options.scheme)


def changes(effect: str, options: argparse.Namespace, folder: Path) -> dict[str, float]:
    """What the effect does to velocities: at strength zero and as given, over its absence; `folder` keeps the builds."""
    level = options.level
    if effect in RESISTANCES and level == "free_draining":
        level = "rotne_prager"  # a torque moves no centre in free draining
    arguments = ["--effects", effect, "--scheme", scheme_for(effect, options), "--level", level]
    whole = Worker(ROOT, arguments)
    try:
        absent = whole.ask("absent", 1)[1]
        felt = largest_change(absent, whole.ask("present", 1)[1])
        if effect not in RESISTANCES:
            return {"zero": largest_change(absent, whole.ask("zero", 1)[1]), "felt": felt}
    finally:
        whole.close()
    to_the_end = folder / "to_the_end"
    if not to_the_end.exists():
        build_to_the_end(to_the_end)
    return {"zero": zero_to_the_end(arguments, to_the_end), "felt": felt}


def times(effect: str, options: argparse.Namespace, folder: Path) -> dict[str, float]:
    """Times of a step with their standard errors, over `options.processes` pairs of processes; `folder` keeps the builds."""
    arguments = ["--effects", effect, "--scheme", scheme_for(effect, options), "--level", options.level]
    never_had = folder / ("none" if effect in RESISTANCES else effect)
    if not never_had.exists():
        build_without(effect, never_had)
    found = []
    for number in range(options.processes):
        whole, cut = Worker(ROOT, arguments), Worker(never_had, arguments)
        try:
            if number == 0 and largest_change(whole.ask("absent", 1)[1], cut.ask("absent", 1)[1]) != 0.0:
                raise SystemExit(f"{effect}: the build that never had it moves primaries otherwise")
            found.append(take_turns(whole, cut, options.rounds, number))
        finally:
            whole.close()
            cut.close()
    row: dict[str, float] = {}
    for name in found[0]:
        values = [one[name] for one in found]
        row[name] = statistics.mean(values)
        if name != "step":
            row[f"error_{name}"] = statistics.stdev(values) / len(values) ** 0.5
    return row


def measure(
    effect: str,
    options: argparse.Namespace,
    folder: Path,
    saved: dict[str, str | float] | None = None,
) -> dict[str, str | float]:
    """One row of the table; with `options.keep_times` the times are those of the saved row."""
    kept = {k: v for k, v in (saved or {}).items() if k in TIMES} if options.keep_times else {}
    row = {"effect": effect, "scheme": scheme_for(effect, options), "level": options.level}
    return {**row, **changes(effect, options, folder), **(kept or times(effect, options, folder))}


TIMES = ("step", "absent", "error_absent", "added", "error_added", "present", "error_present")


def line_of(row: dict[str, str | float]) -> str:
    """A row of the table."""
    value = {name: float(row[name]) for name in row if name not in ("effect", "scheme", "level")}
    return (
        f"| {row['effect']} | {value['zero']:.0e} | {value['felt']:.0e} | {1e6 * value['step']:.1f} "
        f"| {value['absent']:.4f} ± {value['error_absent']:.4f} "
        f"| {1e6 * value['added']:.2f} ± {1e6 * value['error_added']:.2f} "
        f"| {value['present']:.3f} ± {value['error_present']:.3f} |"
    )


def kept_rows(options: argparse.Namespace) -> dict[str, dict[str, str | float]]:
    """{effect: row} of the saved table, where it was measured with the scheme and level of these options."""
    if options.save is None or not options.save.exists():
        return {}
    with options.save.open(newline="", encoding="utf-8") as file:
        return {
            row["effect"]: dict(row)
            for row in csv.DictReader(file)
            if (row["scheme"], row["level"]) == (scheme_for(row["effect"], options), options.level)
        }


def save_rows(path: Path | None, rows: dict[str, dict[str, str | float]]) -> None:
    """Write the table, effects in their order."""
    if path is None:
        return
    from mcdem.netcdf.whole_files import FILES, Kind

    text = io.StringIO()
    names = list(next(iter(rows.values())).keys())
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    for effect in EFFECTS:
        if effect in rows:
            row = rows[effect].items()
            writer.writerow({k: v if isinstance(v, str) else f"{v:.4g}" for k, v in row})
    FILES.write(path, Kind("table of this command", (",".join(names).encode(),)), text.getvalue())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--effects", default=",".join(EFFECTS))
    parser.add_argument("--rounds", type=int, default=10, help="of each pair of processes")
    parser.add_argument("--processes", type=int, default=4, help="pairs of processes")
    parser.add_argument(
        "--save",
        type=Path,
        help="CSV file of the table: rows are renewed, those of effects not measured now are kept",
    )
    parser.add_argument(
        "--keep-times", action="store_true", help="renew what effects change, not saved times"
    )
    parser.add_argument("--scheme", choices=("explicit_euler", "implicit"), default="explicit_euler")
    parser.add_argument(
        "--level", choices=("free_draining", "rotne_prager", "fts", "stokesian"), default="free_draining"
    )
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(options.effects, options.scheme, options.level)
        return
    print("# What an effect costs that a scene does not name\n")
    print(
        f"By `{' '.join(['python benchmarks/absent_effects.py', *sys.argv[1:]])}`: {options.scheme} scheme (resistances of "
        f"contacts: implicit), {options.level}, {PRIMARIES} primaries, mean and standard error of {options.processes} pairs of "
        "processes. The columns are explained at the head of the program.\n"
    )
    print(
        "| effect | strength zero against `None` | strength of the scene against `None` | step, µs "
        "| absent over never there | added when present, µs | present over absent |"
    )
    print("|---|---|---|---|---|---|---|", flush=True)
    rows = kept_rows(options)
    with tempfile.TemporaryDirectory() as folder:
        for effect in options.effects.split(","):
            rows[effect] = measure(effect, options, Path(folder), rows.get(effect))
            save_rows(options.save, rows)
    for effect in EFFECTS:
        if effect in rows:
            print(line_of(rows[effect]))


if __name__ == "__main__":
    main()
