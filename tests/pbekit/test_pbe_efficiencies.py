"""Efficiencies and size-dependent laws against limits, a second derivation, and their sources' numbers."""

from __future__ import annotations

import numpy as np
import pytest

from pbekit import Aggregation, Cells, Grid, KernelError, PopulationBalance, RangeWarning
from pbekit.balance.breakage import (
    BetaSplit,
    Binary,
    CriticalSize,
    Erosion,
    ExponentialRate,
    PowerLawRate,
    SchulzZimm,
    TwoBeta,
    TwoPeak,
    Uniform,
)
from pbekit.balance.efficiencies import (
    Kusters,
    VanDeVenMason,
    VeerapaneniWiesner,
    ZeichnerSchowalter,
    attraction_number,
    fluid_collection,
    happel_permeability,
)
from pbekit.balance.kernels import FractalRadius, ShearEncounter, evaluate


def cells(mass, radius=np.nan):
    mass = np.asarray(mass, float)
    return Cells(mass, np.full(mass.shape, np.nan), np.broadcast_to(np.asarray(radius, float), mass.shape))


@pytest.mark.parametrize("stress, eta", [(750, 0.078), (875, 0.076)])
def test_van_de_ven_mason_gives_the_papers_numbers_and_warns(stress, eta):
    """A_H = 0.97e-20 J, a = 500 nm, g = 1e4 /s (Table 1): 0.078 at 750 Pa, 0.076 at 875 Pa (section 3.1)."""
    attraction = attraction_number(0.97e-20, stress / 1e4, 1e4, 500e-9)
    with pytest.warns(RangeWarning, match="outside 1e-4"):
        law = VanDeVenMason(attraction)
    assert law.value == pytest.approx(eta, abs=6e-4)


def test_efficiencies_say_when_they_leave_their_range():
    VanDeVenMason(1e-3)
    with pytest.warns(RangeWarning):
        Kusters(y=1.5)
    with pytest.warns(RangeWarning, match="0.6"):
        VeerapaneniWiesner(1.0)(cells([8.0], 2.1), cells([8.0], 2.1))
    with pytest.warns(RangeWarning, match="q = 5"):
        CriticalSize(1, 1, 10, q=5)
    with pytest.warns(RangeWarning, match="power = -1"):
        PowerLawRate(1.0, -1.0)
    with pytest.warns(RangeWarning, match="power = 4"):
        ExponentialRate(1.0, 1.0, 1.0, power=4.0)
    with pytest.warns(RangeWarning, match="dimension = 3.5"):
        FractalRadius(1.0, dimension=3.5)
    with pytest.raises(KernelError, match="eta_max"):
        Kusters(1.2)


def porous_sphere_by_matching(xi):
    """Share of the flow through a porous sphere: Stokes outside, Brinkman inside, matched at r = 1 (a linear system).

    Stream function sin^2(theta) f(r): outside f = r^2/2 + A/r + B r; inside f = C r^2 + D (cosh(xi r) - sinh(xi r)/(xi r)).
    Continuous: f, f', tangential stress (f''), pressure.
    """
    c, s = np.cosh(xi), np.sinh(xi)
    g = c - s / xi
    g1 = xi * s - c + s / xi
    g2 = xi**2 * c - xi * s + 2 * c - 2 * s / xi
    # Pressure at the surface over mu cos(theta), from the radial momentum balance: outside 2 B, inside -2 xi^2 C.
    system = np.array([[1, 1, -1, -g], [-1, 1, -2, -g1], [2, 0, -2, -g2], [0, 2, 2 * xi**2, 0]])
    a, b, _, _ = np.linalg.solve(system, np.array([-0.5, -1.0, -1.0, 0.0]))
    return (0.5 + a + b) / 0.5


@pytest.mark.parametrize("xi", [0.049, 0.3, 1.0, 3.0, 10.0, 30.0])
def test_fluid_collection_against_matching(xi):
    assert fluid_collection(xi) == pytest.approx(porous_sphere_by_matching(xi), rel=1e-6)


def test_fluid_collection_limits():
    assert fluid_collection(1e-3) == pytest.approx(1.0, abs=1e-5)
    assert fluid_collection(1e4) == pytest.approx(0.0, abs=2e-4)
    grid = np.geomspace(0.01, 100, 300)
    assert np.all(np.diff(fluid_collection(grid)) < 0)


def test_happel_permeability_is_that_of_single_spheres_when_dilute():
    """Dilute: kappa = 2 a^2/(9 s), each sphere drags by Stokes' law."""
    assert happel_permeability(1e-12, 2.0) * 1e-12 == pytest.approx(8 / 9, rel=1e-3)


EFFICIENCIES = [
    lambda: VanDeVenMason(1e-3),
    lambda: ZeichnerSchowalter(1e-3),
    Kusters,
    lambda: VeerapaneniWiesner(1.0),
]


@pytest.mark.parametrize("make", EFFICIENCIES)
def test_every_efficiency_is_a_symmetric_probability(make):
    grid = Grid.primaries(16, largest=300).with_outer_radius(FractalRadius(1.0, 0.4, 2.0))
    values = evaluate(make(), grid.state)
    assert np.all((values >= 0) & (values <= 1))
    balance = PopulationBalance(grid, [Aggregation(ShearEncounter(1.0) * make())])
    assert np.all(np.isfinite(balance.rhs(0, balance.state(grid.monodisperse(1.0)))))


def test_kusters_prefers_equals_and_small_ones():
    law = Kusters()
    one = lambda i, j: float(law(cells([i]), cells([j]))[0])
    assert one(4, 4) > one(2, 6)
    assert one(2, 2) > one(8, 8)
    assert one(3, 7) == one(7, 3)


@pytest.mark.parametrize(
    "daughters", [Uniform(), BetaSplit(3.0), Binary(), TwoPeak(0.3), TwoBeta(), Erosion(), SchulzZimm(0.2, 3)]
)
def test_daughters_hold_the_mass_of_the_parent(daughters):
    """Both cumulative forms against quadrature of the mass density; whole primaries against their parent."""
    x = np.linspace(0, 1, 200_001)[1:-1]
    density = daughters.mass_density(x)
    density = density / density.sum()
    for at in (0.1, 0.35, 0.8):
        assert density[x <= at].sum() == pytest.approx(float(daughters.mass_below(at)), abs=1e-4)
        number = (density / x)[x <= at].sum()
        assert number == pytest.approx(float(daughters.number_below(at)), rel=2e-3, abs=1e-4)
    size, number = daughters.pieces(37)
    assert size @ number == pytest.approx(37, rel=1e-14)
    assert number.sum() == pytest.approx(float(daughters.number_below(1.0)), rel=0.06)


def test_critical_size_falls_with_stress_to_the_q():
    sizes = [CriticalSize(s, 1000, 30, q=2).critical_size for s in (500, 1000, 2000)]
    np.testing.assert_allclose(sizes, [120, 30, 7.5])
