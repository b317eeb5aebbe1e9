"""The hard cases, as data."""

from __future__ import annotations

import numpy as np

import mcdem
from mcdem.analysis.paired_encounters import level_changes
from validation.fuzz import FOUND
from validation.hard_cases import edges
from validation.hard_cases.case import Case, Encounter, Ensemble, Refused, Shortcut, Suspension
from validation.hard_cases.shapes import (
    at_pull_off,
    ball_centres,
    bent,
    bipyramid_centres,
    chain_centres,
    doublet,
    monomer,
    one_redundant_centres,
    raft_centres,
    ring_centres,
    shape,
    tetrahedron_centres,
    walk_centres,
)

TETRAHEDRON = shape(tetrahedron_centres(), 1), shape(tetrahedron_centres(), 2)
MOTES = monomer, monomer

WITHOUT_ATTRACTION = {"effects.van_der_waals.hamaker_constant": "1e-60 J"}
"""None to speak of; the law stays, so that nothing is compiled for it."""

GRAZING: list[Case] = [
    Encounter("grazing, y0 = 1e-9 R", "starts almost where the undisturbed flow stands still", *MOTES,
              offset=(0.0, 1e-9), outcomes=("aggregation",)),
    Encounter("grazing, clusters, y0 = 1e-9 R", "the same with clusters", *TETRAHEDRON,
              offset=(0.1, 1e-9)),
    Encounter("no offset", "starts where the undisturbed flow stands still; the two draw each other in", *MOTES,
              offset=(0.9, 0.0), outcomes=("missed",)),
    Encounter("grazing, y0 = 1e-3 R", "gives it all the time it needs", *MOTES, offset=(0.0, 1e-3),
              changes={"numerics.longest_approach": 1e4}),
    Encounter("closed orbits", "two primaries that do not attract, started inside of the closed orbits", *MOTES,
              offset=(0.0, 0.02), changes={**WITHOUT_ATTRACTION, "numerics.start_distance": 1.05}, strain=12.0),
    Encounter("edge of capture", "an offset at which hit and miss part", *MOTES, offset=(0.0, 0.343)),
    Encounter("at the rim", "passes at the edge of the circle of R_i + R_j", *TETRAHEDRON, offset=(0.0, 0.9999)),
    Encounter("in the vorticity plane", "two primaries side by side", *MOTES, offset=(0.99, 0.01)),
    Encounter("from below", "an offset below the axis", *TETRAHEDRON, offset=(0.1, -0.4)),
]  # fmt: skip

CONTACTS: list[Case] = [
    Encounter(f"contact at h = {gap:g} a", "gives positions of primaries that just touch, or just do not",
              doublet(gap), monomer, offset=(0.3, 0.6), schemes=("implicit", "explicit_euler"), strain=3.0)
    for gap in (-1e-9, 1e-9)
] + [
    Encounter(f"contact at pull-off {excess:+g} a", "gives a contact stretched to where it ends", at_pull_off(excess),
              monomer, offset=(0.3, 0.6), schemes=("implicit", "explicit_euler"), strain=3.0)
    for excess in (-1e-9, 1e-9)
] + [
    Encounter(f"neighbours {gap:g} a apart, not in contact", "names the contacts of a cluster, and leaves one out",
              bent(gap), monomer, offset=(0.3, 0.6), schemes=("implicit", "explicit_euler"), strain=2.0)
    for gap in (1e-8, 1e-4)
] + [
    Encounter("overlap of 1e-3 a", "positions from another program, rounded", doublet(-1e-3), monomer,
              offset=(0.3, 0.6), schemes=("implicit", "explicit_euler"), strain=3.0),
    Refused("overlap of 0.5 a", "positions in the wrong units",
            lambda scene: doublet(-0.5)(scene), "move them apart"),
    Refused("a number that is none", "positions from a program that failed",
            lambda scene: mcdem.Aggregate.from_positions(scene, [[0.0, 0.0, np.nan]]), "expected finite numbers"),
    Refused("no attraction, said as zero", "A_H = 0 to switch it off", lambda scene: scene.with_changes(
            {"effects.van_der_waals.hamaker_constant": "0 J"}), "hamaker_constant"),
    Refused("no adhesion, said as zero", "gamma = 0 to switch it off", lambda scene: scene.with_changes(
            {"effects.jkr.surface_energy": "0 J/m^2"}), "surface_energy"),
]  # fmt: skip


def ranged(what: str, key: str, values: tuple[str | float, ...], **options) -> list[Encounter]:
    """Tetrahedra that meet, under each value of one key."""
    purpose = f"tries the ends of the range of {key}"
    return [
        Encounter(f"{what} = {value}", purpose, *TETRAHEDRON, changes={key: value}, **options)
        for value in values
    ]


MATERIAL: list[Case] = [
    *ranged("E", "effects.jkr.elastic_modulus", ("10 MPa", "100 MPa", "100 GPa", "1 TPa")),
    *ranged("A_H", "effects.van_der_waals.hamaker_constant", ("1e-60 J", "1e-22 J", "1e-18 J")),
    *ranged("gamma", "effects.jkr.surface_energy", ("1e-9 J/m^2", "1e-4 J/m^2"), chaotic=True),
    *ranged("gamma", "effects.jkr.surface_energy", ("0.1 J/m^2",)),
    *ranged("viscosity", "flow.viscosity", ("1e-3 Pa s",)),
    *ranged("viscosity", "flow.viscosity", ("10 Pa s",), chaotic=True),
    *ranged("shear rate", "flow.shear_rate", ("1 1/s",)),
    *ranged("shear rate", "flow.shear_rate", ("1e6 1/s",), chaotic=True),
    *ranged("delta", "hydrodynamics.lubrication_cutoff", (0.0, 1e-5, 1e-4, 1e-3, 0.1)),
    Encounter("delta = 1e-05, shifted", "reads the cut-off as that of the gap", *TETRAHEDRON, changes={
              "hydrodynamics.lubrication_cutoff": 1e-5, "hydrodynamics.cutoff_convention": "gap"}),
    Encounter("stiff and strongly attracted", "E = 1 TPa and A_H = 1e-18 J at once", *TETRAHEDRON, changes={
              "effects.jkr.elastic_modulus": "1 TPa", "effects.van_der_waals.hamaker_constant": "1e-18 J"}),
    Encounter("the paper's scheme, E = 10 MPa", "explicit steps where contacts are soft", *MOTES, offset=(0.0, 0.25),
              changes={"effects.jkr.elastic_modulus": "10 MPa"}, schemes=("implicit", "explicit_euler"), strain=1.5),
    Encounter("attraction left out", "removes [effects.van_der_waals]", *TETRAHEDRON,
              changes={"effects.van_der_waals": None}, quick=False),
    Encounter("contacts left out", "removes [effects.jkr]: primaries pass", *MOTES, offset=(0.0, 0.25),
              changes={"effects.jkr": None}, quick=False, outcomes=("missed",)),
]  # fmt: skip

LEVELS: list[Case] = [
    Encounter(f"{level}, {name}", "leaves out a part of the hydrodynamics", *shapes, offset=offset, strain=3.0,
              changes=level_changes(level), schemes=("implicit", "explicit_euler"), quick=False, expected={
                  "overlap bounded (explicit_euler)": "without lubrication a snap-in is over within the base step of 1 us, "
                  "which carries the primaries past their contact"})
    for level in ("free_draining", "rotne_prager", "fts")
    for name, shapes, offset in (
        ("two primaries", MOTES, (0.0, 0.25)),
        ("a contact at its end", (at_pull_off(1e-9), monomer), (0.3, 0.6)),
        ("two tetrahedra", TETRAHEDRON, (0.1, 0.4)),
    )
]  # fmt: skip

CLUSTERS: list[Case] = [
    Encounter("one redundant contact", "a cluster whose tensions statics alone does not fix", shape(one_redundant_centres(), 1),
              shape(bipyramid_centres(), 2)),
    Encounter("isostatic clusters", "the clusters of Table 2", shape(bipyramid_centres(), 1),
              shape(bipyramid_centres(), 2)),
    Encounter("closed necklaces", "clusters of the fewest contacts", shape(ring_centres(8), 1),
              shape(ring_centres(8), 2), chaotic=True),
    Encounter("an open necklace of 20", "a floppy fractal cluster", shape(walk_centres(20, 1), 1), monomer,
              chaotic=True, strain=2.0),
    Encounter("a planar raft of 7", "a cluster with no thickness", shape(raft_centres(1), 1), monomer),
    Encounter("a straight chain of 5", "a cluster on a line", shape(chain_centres(5), None), TETRAHEDRON[0]),
    Encounter("a straight chain of 50", "a long rod in strong shear", shape(chain_centres(50), 1), monomer,
              chaotic=True, strain=1.0, quick=False),
    Encounter("a planar raft of 37", "a large flake", shape(raft_centres(3), 1), monomer, chaotic=True, strain=1.0,
              quick=False),
    Encounter("a ball of 147", "a dense, redundant cluster", shape(ball_centres(147), 1), monomer, strain=0.3, quick=False),
    Encounter("two balls of 100", "the largest that meet", shape(ball_centres(100), 1), shape(ball_centres(100), 2),
              strain=0.3, offset=(0.1, 0.8), quick=False),
    Encounter("two balls of 100, head on", "the largest that stick, break each other and restructure for eight rotations",
              shape(ball_centres(100), 1), shape(ball_centres(100), 2), strain=0.3, offset=(0.1, 0.3), quick=False,
              changes={"numerics.most_steps": 300}, outcomes=("unresolved",)),
    Encounter("an open necklace of 60", "a large floppy cluster", shape(walk_centres(60, 2), 1), monomer, chaotic=True,
              strain=0.5, quick=False),
    Encounter("a primary and a cluster of 150", "sizes far apart", monomer, shape(ball_centres(150), 1), strain=0.3,
              offset=(0.1, 0.9), quick=False),
    Ensemble("chaotic clusters", "asks whether the step decides what comes out",
             (*TETRAHEDRON, shape(bipyramid_centres()), shape(ring_centres(8)), shape(walk_centres(8, 1)),
              shape(one_redundant_centres())), 60),
]  # fmt: skip

SUSPENSIONS: list[Case] = [
    Suspension("a population of one", "goes on until all are in one aggregate", {
        "population.initial": 2, "population.doubling_below": 0.0, "flow.shear_stress": "1 Pa"}, 10_000,
        ("one aggregate left",), sticks=True),
    Suspension("nothing sticks", "a stress far above what a contact bears", {
        "population.initial": 20, "flow.shear_stress": "1e6 Pa"}, 60, ("events",), sticks=False),
    Suspension("all in one cluster", "a stress far below what a contact bears", {
        "population.initial": 12, "population.doubling_below": 0.0, "flow.shear_stress": "1 Pa"}, 10_000,
        ("one aggregate left",), sticks=True, quick=False),
    Suspension("encounters that are given up", "too few steps for most", {
        "population.initial": 20, "numerics.most_steps": 40}, 40, ("events",), unresolved=True),
]  # fmt: skip

FULL_LUBRICATION = {"hydrodynamics.lubrication_cutoff": 0.0}
AT_750 = {**FULL_LUBRICATION, "flow.shear_stress": "750 Pa"}
FINE = {"numerics.implicit.max_step": 0.05}
OCTAHEDRON = shape(np.vstack([np.eye(3), -np.eye(3)]) * np.sqrt(2.0), 3)
NEAR_THE_ORBITS = tuple((x, y) for x in (0.3, 0.55) for y in (0.04, 0.08, 0.12, 0.16))

SHORTCUTS: list[Case] = [
    Shortcut("separation: caught when they come back", "two primaries that pass, turn back beyond 1.5 (R_i + R_j) and are caught",
             ("separation",), edges.capture_offset(0.8, 0.05, 0.4), 2e-3, {**AT_750, **FINE},
             exact=edges.exact_capture_offset(0.8, 0.05, 0.4), off_by=5e-3),
    Shortcut("separation: caught when they come back, 1200 Pa", "the same at another stress and offset",
             ("separation",), edges.capture_offset(0.6, 0.05, 0.6), 2e-3,
             {**AT_750, **FINE, "flow.shear_stress": "1200 Pa"},
             exact=edges.exact_capture_offset(0.6, 0.05, 0.6), off_by=5e-3, quick=False),
    Shortcut("separation: clusters near the closed orbits", "aggregates that may come back", ("separation",),
             edges.returns(*TETRAHEDRON, NEAR_THE_ORBITS), 0.5, outright=True, quick=False),
    *[Shortcut(f"separation: stray at {offset}", "looks where two primaries go after they have passed", ("separation",),
               edges.stray(offset, 60.0 if offset[1] > 0.5 else 30.0), 1e-2,
               {**FULL_LUBRICATION, **WITHOUT_ATTRACTION, **FINE, "numerics.rotations": 6}, outright=True,
               exact=lambda scene: 0.0, off_by=1e-2, quick=offset == (0.0, 1.5))
      for offset in ((0.0, 1.5), (0.7, 0.5), (1.2, 0.25))],
    Shortcut("far approach: edge of capture", "an offset at which hit and miss part", ("far_approach",),
             edges.capture_offset(0.0, 0.4, 1.0), 1e-3, {**AT_750, **FINE},
             exact=edges.exact_capture_offset(0.0, 0.4, 1.0), off_by=1e-3),
    Shortcut("far approach: within the closed orbits", "starts where the two draw each other in, sooner than the flow does",
             ("far_approach",), edges.capture_offset(0.9, 0.02, 0.4), 1e-2, {**AT_750, **FINE}),
    Shortcut("frozen far field: edge of contact of clusters", "an offset at which clusters just touch",
             ("implicit.far_field_tolerance",), edges.touching_offset(*TETRAHEDRON, 0.2, 0.9), 5e-3, quick=False),
    Shortcut("sure miss: edge of contact of clusters", "an offset at which clusters just touch",
             ("far_approach", "sure_miss", "separation"), edges.touching_offset(*TETRAHEDRON, 0.2, 0.9), 1e-2, quick=False),
    Shortcut("sure miss: a gap of half a radius", "clusters that pass at the gap from which on they pass as bodies",
             ("far_approach", "sure_miss", "separation"), edges.passing_gap(*TETRAHEDRON, (0.0, 0.62)), 0.1, outright=True),
    *[Shortcut(f"{name}: stress that breaks {what}", "a stress at which an aggregate just breaks", keys,
               edges.breaking_stress(broken, low, high), 0.02, quick=False)
      for name, keys in (("rigid rotation", ("rigid_rotation",)), ("stable in every orientation", ("end_stable", "separation")))
      for what, broken, low, high in (("a doublet", doublet(0.0), 500.0, 20000.0),
                                      ("an octahedron", OCTAHEDRON, 500.0, 20000.0))],
]  # fmt: skip

CATALOGUE: tuple[Case, ...] = (
    *GRAZING,
    *CONTACTS,
    *MATERIAL,
    *LEVELS,
    *CLUSTERS,
    *SUSPENSIONS,
    *SHORTCUTS,
    *FOUND,
)
