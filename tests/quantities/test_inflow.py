"""Encounters in any steady linear flow: rates, points of entry, streamlines, and what flows other than shear do to pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from effects_family import scene as scene_of
from scipy import stats
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

import mcdem
from mcdem.encounter.simulate import start_of
from mcdem.errors import SceneError, UserError
from mcdem.quantities.linear_flows import (
    draw_direction,
    draw_offset,
    entry_of,
    gradient,
    inflow_constant,
    offset_of,
    turns_back,
    upstream,
)

SHEAR = scene_of("jkr")
RADIUS = SHEAR.suspension.radius
KINDS = {
    "simple_shear": {},
    "planar": {"flow.alpha": 0.3},
    "planar_extension": {},
    "uniaxial_extension": {},
    "biaxial_extension": {},
    "linear": {"flow.gradient": [[-0.7, 0, 0], [0, -0.3, 0], [0, 0, 1]]},
}
EXACT = {
    "simple_shear": 4 / 3,
    "planar": 4 / 3 * 1.3,
    "planar_extension": 8 / 3,
    "uniaxial_extension": 4 * math.pi / 3**1.5,
    "biaxial_extension": 4 * math.pi / 3**1.5,
}
MONOMER = mcdem.Aggregate.monomer()


def in_flow(kind, **changes):
    return SHEAR.with_changes({"flow.kind": kind} | KINDS[kind] | changes)


def on_sphere(count=600):
    """Points (K, 3) and weights (K,) of a product rule over the unit sphere."""
    c, weight = np.polynomial.legendre.leggauss(count)
    phi = 2 * np.pi * np.arange(2 * count) / (2 * count)
    s = np.sqrt(1 - c**2)
    n = np.stack([np.outer(s, np.cos(phi)), np.outer(s, np.sin(phi)), np.outer(c, np.ones(2 * count))], -1)
    return n.reshape(-1, 3), np.repeat(weight * np.pi / count, 2 * count)


@pytest.mark.parametrize("kind", EXACT)
def test_the_rate_is_the_flux_into_the_sphere(kind):
    flow, (n, weight) = in_flow(kind).flow, on_sphere()
    G = gradient(flow)
    inward = -np.einsum("ki,ij,kj->k", n, G, n)
    # The kink where the flux changes its sign limits the rule to 1e-4.
    assert weight @ np.maximum(inward, 0) == pytest.approx(EXACT[kind], rel=1e-4)
    assert weight @ inward == pytest.approx(0, abs=1e-12)
    assert inflow_constant(flow) == pytest.approx(EXACT[kind], rel=1e-14)
    assert flow.equivalent_shear_rate == pytest.approx(0.75 * EXACT[kind] * flow.shear_rate, rel=1e-14)
    assert np.trace(G) == 0.0


@pytest.mark.parametrize("kind", EXACT)
def test_a_flow_given_by_its_gradient_meets_at_the_rate_of_the_one_named(kind):
    named = in_flow(kind).flow
    assert inflow_constant(by_gradient(gradient(named)).flow) == pytest.approx(EXACT[kind], rel=1e-10)


def by_gradient(G, **changes):
    return SHEAR.with_changes({"flow.kind": "linear", "flow.gradient": np.asarray(G).tolist()} | changes)


def random_flows(count, seed):
    """Strains with as much vorticity as leaves every streamline coming from far away, and some more."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        E, W = rng.normal(size=(2, 3, 3))
        E = E + E.T
        yield E - np.trace(E) / 3.0 * np.eye(3), rng.uniform(0.0, 2.0) * (W - W.T)


def test_the_rate_of_any_gradient_is_the_flux_into_the_sphere_and_takes_its_strain_alone():
    n, weight = on_sphere()
    for E, W in random_flows(8, 7):
        if turns_back(E + W):
            continue
        inward = -np.einsum("ki,ij,kj->k", n, E, n)
        found = inflow_constant(by_gradient(E + W).flow)
        assert found == pytest.approx(weight @ np.maximum(inward, 0), rel=1e-4)
        assert found == pytest.approx(inflow_constant(by_gradient(E).flow), rel=1e-9)


def test_streamlines_turn_back_where_the_distance_along_them_is_not_convex():
    """Against second differences of r^2 along streamlines through many points, for strains with vorticity and without."""
    rng, found = np.random.default_rng(9), set()
    starts = rng.normal(size=(3, 4000))
    for E, W in random_flows(40, 8):
        assert not turns_back(E)
        G, h = E + W, 1e-3
        r = [((expm(t * G) @ starts) ** 2).sum(axis=0) for t in (-h, 0.0, h)]
        curved = ((r[0] - 2.0 * r[1] + r[2]) / h**2 / r[1]).min()
        if abs(curved) > 0.1:  # the worst of 4000 points is not the very worst
            assert turns_back(G) == (curved < 0.0)
            found.add(turns_back(G))
    assert found == {True, False}
    for share, expected in ((0.0, False), (0.3, False), (-1e-3, True)):
        assert turns_back(np.array([[0, 0, 0], [0, 0, share], [0, 1, 0]])) == expected


def test_simple_shear_meets_at_the_rate_of_the_paper_to_the_last_bit():
    assert SHEAR.flow.equivalent_shear_rate == SHEAR.flow.shear_rate


def test_points_of_entry_in_shear_are_those_of_the_paper():
    """The general way against the paper's: 10 000 points each, Kolmogorov-Smirnov at 0.1 %, sees a shift of 0.028."""
    flow, rng = SHEAR.flow, np.random.default_rng(1)
    general = np.array([offset_of(flow, 2.0 * draw_direction(gradient(flow), rng)) for _ in range(10_000)])
    paper = np.array([draw_offset(flow, 2.0, rng) for _ in range(10_000)])
    for column in range(2):
        assert stats.ks_2samp(general[:, column], paper[:, column]).pvalue > 1e-3
    product = general[:, 0] * general[:, 1], paper[:, 0] * paper[:, 1]
    assert stats.ks_2samp(*product).pvalue > 1e-3


@pytest.mark.parametrize("offset", [(0.3, 0.7), (-1.2, 1.1), (0.0, -0.4)])
def test_upstream_in_shear_is_the_start_of_the_paper_and_eq_21(offset):
    """Exactly: the streamline keeps (x, y), and from there to the nearest point it takes |z0|/|y0|."""
    start, strain, cut = start_of(SHEAR, 2.0, offset)
    entry = entry_of(SHEAR.flow, 2.0, offset)
    assert entry[:2] == pytest.approx(offset) and np.linalg.norm(entry) == pytest.approx(2.0)
    found, approach = upstream(gradient(SHEAR.flow), entry, float(np.linalg.norm(start)))
    assert found == pytest.approx(start, rel=1e-10, abs=1e-10) and not cut
    assert approach == pytest.approx(abs(start[2] / offset[1]), rel=1e-10)
    assert strain == pytest.approx(approach + 4 * math.pi * SHEAR.numerics.rotations, rel=1e-10)


CONSERVED = {
    "planar": lambda x, y, z: (x, y * y - 0.3 * z * z),
    "planar_extension": lambda x, y, z: (x, y * y - z * z),
    "uniaxial_extension": lambda x, y, z: (math.atan2(y, x), (x * x + y * y) * z),
    "biaxial_extension": lambda x, y, z: (math.atan2(y, x), (x * x + y * y) * z),
    "linear": lambda x, y, z: (x * abs(z) ** 0.7, y * abs(z) ** 0.3),
}


@pytest.mark.parametrize("kind", CONSERVED)
def test_upstream_keeps_to_the_streamline(kind):
    """The stream function is that of the point of entry; the offset says all of it but the symmetries of the flow."""
    flow, rng = in_flow(kind).flow, np.random.default_rng(2)
    for _ in range(50):
        offset = draw_offset(flow, 3.0, rng)
        entry = entry_of(flow, 3.0, offset)
        assert entry @ gradient(flow) @ entry < 0.0 and np.linalg.norm(entry) == pytest.approx(3.0)
        assert offset_of(flow, entry) == pytest.approx(offset)
        start, approach = upstream(gradient(flow), entry, 15.0)
        assert np.linalg.norm(start) == pytest.approx(15.0, rel=1e-9) and approach > 0.0
        assert CONSERVED[kind](*start) == pytest.approx(CONSERVED[kind](*entry), rel=1e-8, abs=1e-8)


def test_streamlines_next_to_stagnant_fluid_are_given_up():
    """In a planar flow of hardly any extension they hardly move: the approach is cut by name, not ended by a traceback."""
    start, strain, cut = start_of(
        in_flow("planar", **{"flow.alpha": 1e-9}), 2.0 * RADIUS, (0.0, 2e-6 * RADIUS)
    )
    assert cut and np.isfinite(start).all() and math.isfinite(strain)


def test_heights_of_entry_in_extension_follow_the_flux():
    """Density 1 - 3 c^2 of the height c in the sphere between the cones: 5000 draws at 0.1 %."""
    flow, rng = in_flow("uniaxial_extension").flow, np.random.default_rng(3)
    c = np.array([draw_offset(flow, 1.0, rng)[1] for _ in range(5000)])
    top = 1 / math.sqrt(3)
    cumulative = lambda c: (c - c**3 + top - top**3) / (2 * (top - top**3))
    assert stats.kstest(c, cumulative).pvalue > 1e-3


def test_where_nothing_flows_in_is_refused():
    for kind, offset in [
        ("uniaxial_extension", (0.0, 1.2)),
        ("biaxial_extension", (0.3, 0.5)),
        ("planar", (0, 2)),
        ("linear", (1.9, 0.0)),
    ]:
        with pytest.raises(UserError, match="cannot meet i"):
            entry_of(in_flow(kind).flow, 2.0, offset)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flow.kind": "planar"}, "needs alpha"),
        ({"flow.alpha": 0.5}, "has no alpha"),
        ({"flow.kind": "planar_extension", "numerics.scheme": "explicit_euler"}, "is one for simple shear"),
        ({"flow.kind": "planar_extension", "numerics.separation": 0.0}, "recede exponentially"),
        ({"flow.kind": "elongation"}, "uniaxial_extension"),
        ({"flow.kind": "linear"}, 'kind = "linear" and gradient go together'),
        ({"flow.gradient": [[0, 0, 0], [0, 0, 0], [0, 1, 0]]}, "go together"),
        (
            {"flow.kind": "linear", "flow.gradient": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
            "the trace 3, expected 0",
        ),
        ({"flow.kind": "linear", "flow.gradient": [[0, 1, 0], [-1, 0, 0], [0, 0, 0]]}, "a rotation alone"),
        ({"flow.kind": "linear", "flow.gradient": [[0, 0, 0], [0, 0, -0.1], [0, 1, 0]]}, "turn back"),
        ({"flow.kind": "linear", "flow.gradient": [[1, 0], [0, -1]]}, "three rows of three"),
    ],
)
def test_flows_are_refused_in_words(changes, words):
    with pytest.raises(SceneError, match=words):
        SHEAR.with_changes(changes)


def test_eta_11_is_refused_outside_shear():
    with pytest.raises(UserError, match="offsets of simple shear"):
        mcdem.pair_efficiency(in_flow("planar_extension"))


# Encounters.  Free draining: paths are the streamlines until the spheres touch.

FREE = {"hydrodynamics.level": "free_draining", "numerics.rotations": 1}
# A doublet that bears its worst orientation is otherwise not followed until it is there.
TO_THE_END = {"numerics.end_stable": False}


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "simple_shear"])
def test_primaries_of_free_draining_meet_where_their_streamline_enters(kind):
    """At the strain of the streamline, whatever the flow: second order steps of at most 0.05."""
    s = in_flow(kind, **FREE, **{"numerics.implicit.max_step": 0.05})
    rng, G = np.random.default_rng(4), gradient(s.flow)
    for _ in range(3):
        offset = draw_offset(s.flow, 2.0, rng)
        entry = entry_of(s.flow, 2.0, offset)
        start, _ = upstream(G, entry, 2.0 * s.numerics.start_distance)
        result = mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=tuple(RADIUS * c for c in offset))
        assert result.contact
        strain = strain_between(G, start, entry)
        assert result.first_contact_time * s.flow.shear_rate == pytest.approx(strain, abs=2e-3)


def strain_between(G, start, entry):
    """Strain along the streamline from `start` to `entry`, by where its distance from the latter is least."""
    gone = lambda strain: float(np.linalg.norm(expm(strain * G) @ start - entry))
    times = np.linspace(0.0, 20.0, 2001)
    coarse = times[np.argmin([gone(t) for t in times])]
    found = minimize_scalar(
        gone, bounds=(coarse - 0.01, coarse + 0.01), method="bounded", options={"xatol": 1e-10}
    )
    assert found.fun < 1e-6
    return found.x


@pytest.mark.parametrize("kind", ["uniaxial_extension", "planar_extension"])
def test_a_doublet_turns_into_the_stretching_and_bears_its_pull(kind):
    """Free draining: it bears half its length times the rate of stretching, r g/2, along the axis; for a strain of 100."""
    s = in_flow(kind, **FREE | {"numerics.rotations": 8} | TO_THE_END)
    result = mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=(0.0, 0.4 * RADIUS))
    assert result.outcome == "aggregation"
    (doublet,) = result.products
    axis = doublet.positions[1] - doublet.positions[0]
    stretching = [0, 0, 1] if kind == "uniaxial_extension" else [0, math.sqrt(0.5), math.sqrt(0.5)]
    assert abs(axis @ stretching) == pytest.approx(np.linalg.norm(axis), rel=1e-6)
    assert result.largest_tension == pytest.approx(s.reduced.force, rel=1e-3)


def test_parts_go_their_ways_without_end_and_stay_exact():
    """Strain 100: positions seen from the origin would grow as e^100."""
    s = in_flow("uniaxial_extension", **FREE, **{"effects.jkr.surface_energy": "0.5e-3 J/m^2"})
    s = s.with_changes({"numerics.rotations": 8})
    result = mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=(0.0, 0.2 * RADIUS))
    assert result.outcome == "parted" and result.simulated_time * s.flow.shear_rate > 100.0
