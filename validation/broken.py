"""Physics broken on purpose, one way at a time, to show that a case would notice.

    python -m validation NAME --break strain_sign

Each entry of `WAYS` is a context manager that breaks the toolkit in this process until it is left.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from unittest import mock

import numpy as np

from mcdem.effects.van_der_waals import VanDerWaalsKernel


def _change_physics(change: Callable) -> contextlib.ExitStack:
    """Every encounter and every velocity sees (flow, physics) as `change` makes them."""
    from mcdem import free_spheres
    from mcdem.encounter import simulate as encounter
    from validation.hard_cases import watch

    intact = encounter.physics_of
    stack = contextlib.ExitStack()
    for module in (encounter, free_spheres, watch):
        stack.enter_context(
            mock.patch.object(module, "physics_of", lambda scene: change(scene, *intact(scene)))
        )
    return stack


@contextlib.contextmanager
def strain_sign() -> Iterator[None]:
    """The rate of strain acts on the stresslets with the wrong sign."""
    with _change_physics(
        lambda _, flow, physics: (flow._replace(strain=-flow.strain, strain_five=-flow.strain_five), physics)
    ):
        yield


@contextlib.contextmanager
def no_lubrication() -> Iterator[None]:
    """Pairs have no two-body resistance beyond the far field."""

    def change(_, flow, physics):
        table = physics.level.lubrication
        without = table._replace(coefficients=np.zeros_like(table.coefficients))
        return flow, physics._replace(level=physics.level._replace(lubrication=without))

    with _change_physics(change):
        yield


@contextlib.contextmanager
def delta_moved() -> Iterator[None]:
    """The lubrication cut-off is at 2e-2 whatever the scene says."""
    with _change_physics(
        lambda _, flow, physics: (flow, physics._replace(level=physics.level._replace(cutoff=2e-2)))
    ):
        yield


@contextlib.contextmanager
def distances_long() -> Iterator[None]:
    """Free spheres interact as if they were 5 % further apart."""
    from mcdem import free_spheres
    from mcdem.hydrodynamics.velocities import solve_velocities as intact

    with mock.patch.object(
        free_spheres,
        "solve_velocities",
        lambda level, work, positions, *rest: intact(level, work, 1.05 * positions, *rest),
    ):
        yield


@contextlib.contextmanager
def distances_double() -> Iterator[None]:
    """Free spheres interact as if they were twice as far apart."""
    from mcdem import free_spheres
    from mcdem.hydrodynamics.velocities import solve_velocities as intact

    with mock.patch.object(
        free_spheres,
        "solve_velocities",
        lambda level, work, positions, *rest: intact(level, work, 2.0 * positions, *rest),
    ):
        yield


@contextlib.contextmanager
def weak_attraction() -> Iterator[None]:
    """Van der Waals attraction is a third of what the scene says."""

    def change(_, flow, physics):
        return flow, physics._replace(
            pair_forces=tuple(
                law._replace(strength=law.strength / 3.0) if isinstance(law, VanDerWaalsKernel) else law
                for law in physics.pair_forces
            )
        )

    with _change_physics(change):
        yield


def _change_functions(names: tuple[str, ...], factor: float) -> contextlib.AbstractContextManager:
    """Two-sphere functions of these families, times a factor, wherever the exact ones are summed."""
    from mcdem.hydrodynamics.two_sphere import tables as two_sphere

    intact = two_sphere.exact

    def exact(gap, ratio=1.0):
        return {
            name: factor * value if name[:2] in names else value for name, value in intact(gap, ratio).items()
        }

    # `resistance_matrix` holds the function as its default argument.
    stack = contextlib.ExitStack()
    stack.enter_context(mock.patch.object(two_sphere, "exact", exact))
    stack.enter_context(mock.patch.object(two_sphere.resistance_matrix, "__defaults__", (1.0, exact)))
    return stack


@contextlib.contextmanager
def weak_contacts() -> Iterator[None]:
    """Contacts break at 80 % of the pull-off force that the scene says."""

    def change(_, flow, physics):
        law = physics.contact
        if law is None:
            return flow, physics
        scaled = {
            k: 0.8 * v for k, v in law._asdict().items() if k in ("pull_off_force", "equilibrium_stiffness")
        }
        return flow, physics._replace(contact=law._replace(**scaled))

    with _change_physics(change):
        yield


@contextlib.contextmanager
def torque_sign() -> Iterator[None]:
    """Y^B and Y^H of two spheres have the wrong sign: forces are right, rotation is not."""
    with _change_functions(("YB", "YH"), -1.0):
        yield


@contextlib.contextmanager
def squeeze_low() -> Iterator[None]:
    """X^A of two spheres is 2 % low."""
    with _change_functions(("XA",), 0.98):
        yield


@contextlib.contextmanager
def doubling_loses_a_copy() -> Iterator[None]:
    """When the sample is doubled, the copy of the largest aggregate is lost."""
    from mcdem.monte_carlo.population import SamplePopulation

    intact = SamplePopulation.double

    def double(self):
        largest = max(self, key=lambda placed: placed[1].size)[0]
        before = self.number
        intact(self)
        copies = [place for place, a in self if a is self.aggregates[largest] and place != largest]
        assert self.number == 2 * before
        self._take(max(copies))

    with mock.patch.object(SamplePopulation, "double", double):
        yield


@contextlib.contextmanager
def flat_encounter_rates() -> Iterator[None]:
    """Pairs of the sample meet at rates that do not grow with their size."""
    from mcdem.monte_carlo.population import SamplePopulation

    intact = SamplePopulation._count

    def count(self, place, aggregate, sign):
        intact(self, place, aggregate, sign)
        if sign > 0:
            self.outer_radii[place] = 2.0 * self.primary_radius

    with mock.patch.object(SamplePopulation, "_count", count):
        yield


@contextlib.contextmanager
def aggregation_half() -> Iterator[None]:
    """Kernels of the population balance are half of what they should be, as when pairs are counted wrongly."""
    from pbekit.balance import kernels

    def halved(intact):
        return lambda self, i, j: 0.5 * intact(self, i, j)

    with contextlib.ExitStack() as stack:
        for kernel in (kernels.Constant, kernels.Sum, kernels.Product):
            stack.enter_context(mock.patch.object(kernel, "__call__", halved(kernel.__call__)))
        yield


@contextlib.contextmanager
def clock_slow() -> Iterator[None]:
    """The process time of a run is read as twice what it was."""
    from mcdem.analysis.dataset import RunDataset
    from validation import datasets

    intact, series = RunDataset.time.fget, datasets.series  # type: ignore[attr-defined]  # a property

    def slow():
        run = series()
        return replace(run, time=2.0 * run.time)

    with (
        mock.patch.object(RunDataset, "time", property(lambda self: 2.0 * intact(self))),
        mock.patch.object(datasets, "series", slow),
    ):
        yield


@contextlib.contextmanager
def stresses_inverted() -> Iterator[None]:
    """The runs at high stress are taken for those at low stress, and the other way round."""
    from mcdem.analysis.dataset import RunDataset

    intact = RunDataset.stress.fget  # type: ignore[attr-defined]  # a property
    with mock.patch.object(RunDataset, "stress", property(lambda self: 1e6 / intact(self))):
        yield


@contextlib.contextmanager
def outcomes_shuffled() -> Iterator[None]:
    """The encounters of the committed table have each other's outcomes, whatever their sizes."""
    from validation import datasets

    intact = datasets.kernels

    def shuffled():
        table = intact()
        drawn = np.random.default_rng(0).permutation(table.records.outcome)
        return table.with_records(replace(table.records, outcome=drawn))

    with mock.patch.object(datasets, "kernels", shuffled):
        yield


@contextlib.contextmanager
def smallest_for_largest() -> Iterator[None]:
    """Of what broke, what is left beside the largest fragment is taken for the largest."""
    from mcdem.analysis import dataset as runs
    from mcdem.analysis.breakup import breakups as intact

    def breakups(*columns):
        found = intact(*columns)
        return found.assign(largest_fragment=1.0 - found["largest_fragment"])

    with mock.patch.object(runs, "breakups", breakups):
        yield


@contextlib.contextmanager
def coarse_default() -> Iterator[None]:
    """In a saved table of `mcdem cost` the scene as given has the error of twice its step, and the reference's time."""
    from validation import datasets

    intact = datasets.prices

    def prices(path):
        rows = {row["setting"]: row for row in intact(path)}
        coarse = max((r for r in rows.values() if r["varied"] == "max_step"), key=lambda r: r["error_eta_11"])
        time = {"cpu_time_s": rows["reference"]["cpu_time_s"]}
        rows["as given"] = coarse | {"setting": "as given", "varied": "as given"} | time
        return list(rows.values())

    with mock.patch.object(datasets, "prices", prices):
        yield


@contextlib.contextmanager
def absent_left_in() -> Iterator[None]:
    """The paper's van der Waals attraction acts in scenes that do not name it."""

    def change(scene, flow, physics):
        if scene.effects.get("van_der_waals") is not None:
            return flow, physics
        table = {"hamaker_constant": "0.97e-20 J", "minimum_approach": "0.165 nm"}
        named = scene.with_changes({"effects.van_der_waals": table})
        return flow, physics._replace(pair_forces=named.kernels.pair_forces)

    with _change_physics(change):
        yield


@contextlib.contextmanager
def absent_costs() -> Iterator[None]:
    """In the saved table of absent effects each costs a step 5 %."""
    from validation import datasets

    intact = datasets.absent_effects
    with mock.patch.object(
        datasets, "absent_effects", lambda: [row | {"absent": 1.05 * row["absent"]} for row in intact()]
    ):
        yield


@contextlib.contextmanager
def stresses_of_others() -> Iterator[None]:
    """In the saved table of clusters that were sheared until they broke, each has the stresses of another."""
    from validation import datasets

    intact = datasets.fractal_motion

    def turned():
        rows = intact()
        others = [*rows][1::2] + [*rows][::2]
        taken = ("first", "split")
        return {
            name: row | {key: rows[other][key] for key in taken}
            for (name, row), other in zip(rows.items(), others)
        }

    with mock.patch.object(datasets, "fractal_motion", turned):
        yield


@contextlib.contextmanager
def weights_lost() -> Iterator[None]:
    """Encounters that were drawn where they narrow the error most count as if they were drawn by the flux."""
    from pbekit.tables.kernel_table import Records

    read = Records.__post_init__

    def without(records: Records) -> None:
        object.__setattr__(records, "weight", None)
        read(records)

    with mock.patch.object(Records, "__post_init__", without):
        yield


WAYS: dict[str, Callable[[], contextlib.AbstractContextManager]] = {
    way.__name__: way
    for way in (
        strain_sign,
        no_lubrication,
        delta_moved,
        distances_long,
        distances_double,
        weak_attraction,
        weak_contacts,
        torque_sign,
        squeeze_low,
        doubling_loses_a_copy,
        flat_encounter_rates,
        aggregation_half,
        clock_slow,
        outcomes_shuffled,
        smallest_for_largest,
        coarse_default,
        absent_left_in,
        absent_costs,
        stresses_of_others,
        weights_lost,
        stresses_inverted,
    )
}


def broken(way: str | None) -> contextlib.AbstractContextManager:
    """Break physics in this way; nothing for None."""
    return contextlib.nullcontext() if way is None else WAYS[way]()
