"""Laws that hold for every effect.  An effect without a sample in effects_family.py fails the first of them."""

from __future__ import annotations

import re
from importlib import import_module
from itertools import product

import numpy as np
import pint
import pytest
from effects_family import (
    CONTACT_LAWS,
    PAIR_FORCES,
    RESISTANCES,
    TABLES,
    VARIANTS,
    effect_of,
    effects,
    kernels,
    scene,
)
from effects_family import kernel as kernel_of
from pydantic import ValidationError

from mcdem.effects import EFFECTS, Effects, Kernels
from mcdem.effects.sums import contact_force, non_contact_force

FORCES = PAIR_FORCES + CONTACT_LAWS

# Gaps over the radius, across every branch of every force; slopes have kinks at some, not here.
GAPS = [-3e-3, -4e-4, -1e-4, 3e-5, 2e-4, 1e-3, 7e-3, 0.02, 0.039, 0.3]
# The unit of each parameter of a kernel, in order; the first one is the strength, to which the force is proportional.
UNITS = {
    "van_der_waals": ("J", "m", "1/m"),
    "unretarded": ("J", "m", None),
    "double_layer": ("N", "1/m", "", "m"),
    "constant_charge": ("N", "1/m", "", "m"),
    "born": ("J", "m"),
    "steric": ("Pa", "m"),
    # Parameters of contacts are for a unit of a_eff and grow with a power of it.
    "jkr": ("N/m", "m^(2/3)", "m^(2/3)", "m^(2/3)", "N/m^(5/3)"),
    "dmt": ("N/m", "Pa", "m", "m^(2/3)", "N/m^(5/3)"),
}


def module(name):
    return import_module(f"mcdem.effects.{effect_of(name)}")


def kernel(name, radius=500e-9):
    return kernel_of(scene(name, radius=radius), name)


def gaps(name):
    """Gaps at which the law of `name` is smooth; an overlap without contact is not."""
    return [h for h in GAPS if name in CONTACT_LAWS or h > 0]


def test_every_effect_is_in_one_family():
    assert set(Effects.model_fields) == {*PAIR_FORCES, *CONTACT_LAWS, *RESISTANCES} - set(VARIANTS)
    assert set(TABLES) == set(Effects.model_fields) == set(EFFECTS)
    assert set(UNITS) == {*FORCES}


@pytest.mark.parametrize("name", list(EFFECTS))
def test_an_effect_states_what_its_parameters_are(name):
    """Compiled code finds a law by the type of its parameters: each effect has one of its own."""
    assert type(kernel(name)) is EFFECTS[name].kernel
    assert [other for other, effect in EFFECTS.items() if effect.kernel is EFFECTS[name].kernel] == [name]
    assert type(scene(name).effects.get(name)) is EFFECTS[name].table


@pytest.mark.parametrize("name", list(TABLES))
def test_every_effect_names_its_source_and_its_exact_or_limiting_test(name):
    page = import_module(f"mcdem.effects.{name}").__doc__
    assert re.search(r"^Source: ", page, re.M) and re.search(r"^(Exact|Limiting) tests?: ", page, re.M)


@pytest.mark.parametrize("radius", [0.4, 1.0, 1.7])
@pytest.mark.parametrize("name", FORCES)
def test_slope_is_the_derivative_of_the_force(name, radius):
    force, kernel_ = module(name).force, kernel(name)
    for h in gaps(name):
        step = 1e-4 * abs(h)
        F = {k: force(h + k * step, radius, kernel_)[0] for k in (-2, -1, 1, 2)}
        difference = (8 * (F[1] - F[-1]) - (F[2] - F[-2])) / (12 * step)
        value, slope = force(h, radius, kernel_)
        # Differences lose digits to rounding of F: eps F/step.
        assert slope == pytest.approx(difference, rel=1e-8, abs=1e-15 * abs(value) / step)


@pytest.mark.parametrize("name", PAIR_FORCES)
def test_a_force_without_contact_vanishes_far_away(name):
    """Faster than 1/h, so that its work from infinity is finite; and on the way its sign and that of its slope never change."""
    force, kernel_ = module(name).force, kernel(name)
    far = [h * force(h, 1.0, kernel_)[0] for h in (1e-3, 1.0, 1e3)]
    assert abs(far[1]) < 3e-2 * abs(far[0]) and abs(far[2]) <= 2e-3 * abs(far[1])
    values = np.array([force(h, 1.0, kernel_) for h in np.geomspace(1e-6, 1e2, 400)])
    assert np.all(values[:, 0] * values[0, 0] >= 0) and np.all(values[:, 1] * values[0, 0] <= 0)


@pytest.mark.parametrize("name", FORCES)
def test_a_force_is_continuous_and_finite(name):
    """Through touching and deep overlap: no step larger than its slope accounts for."""
    force, kernel_ = module(name).force, kernel(name)
    for h in (-0.5, 0.0, -1e-9, 1e-9, *GAPS):
        value, slope = force(h, 1.0, kernel_)
        beyond = force(h + 1e-12, 1.0, kernel_)[0]
        assert np.isfinite(value) and np.isfinite(slope)
        assert abs(beyond - value) <= 1e-12 * (2 * abs(slope) + 100 * abs(value) / 1e-3)


@pytest.mark.parametrize("radius", [0.4, 1.7])
@pytest.mark.parametrize("name", FORCES)
def test_two_spheres_of_one_radius_are_the_scene_of_that_radius(name, radius):
    """The harmonic mean enters as the radius of two equal spheres does: lengths scale by it, forces by its square."""
    force, kernel_, own = module(name).force, kernel(name), kernel(name, radius=radius * 500e-9)
    for h in gaps(name):
        value, slope = force(h, radius, kernel_)
        own_value, own_slope = force(h / radius, 1.0, own)
        assert value == pytest.approx(own_value * radius**2, rel=1e-12)
        assert slope == pytest.approx(own_slope * radius, rel=1e-12)


@pytest.mark.parametrize("name", FORCES)
def test_dimensions_are_proven(name, monkeypatch):
    """The formula itself, uncompiled, evaluated with quantities in SI: a force and a force over a length, and their values."""
    ureg = pint.UnitRegistry()
    home = module(name)
    reduced, unit, compiled = kernel(name), scene(name).reduced, home.force
    for key, value in vars(home).items():
        if hasattr(value, "kernel") and hasattr(value, "__wrapped__"):
            monkeypatch.setattr(home, key, value.__wrapped__)

    def quantity(value, units):
        if value is None:
            return None
        dimension = ureg.Quantity(1.0, units).dimensionality
        force = float(dimension.get("[mass]", 0))
        length = float(dimension.get("[length]", 0)) - force
        return value * (unit.force * ureg.N) ** force * (unit.length * ureg.m) ** length

    in_si = type(reduced)(*map(quantity, reduced, UNITS[name]))
    for value, units in zip(in_si, UNITS[name]):
        assert value is None or value.check(ureg.Quantity(1.0, units).dimensionality)

    def si(result, units):
        # A plain zero has any dimension.
        return (
            (result if isinstance(result, pint.Quantity) else ureg.Quantity(result, units))
            .to(units)
            .magnitude
        )

    for h in GAPS:
        value, slope = home.force(h * unit.length * ureg.m, unit.length * ureg.m, in_si)
        expected, expected_slope = compiled(h, 1.0, reduced)
        assert si(value, "N") == pytest.approx(expected * unit.force, rel=1e-12)
        assert si(slope, "N/m") == pytest.approx(expected_slope * unit.stiffness, rel=1e-12)


def non_contact_combinations():
    """Every set of forces between spheres not in contact that a scene may name."""
    for attraction, layer in product(
        (None, "van_der_waals", "unretarded"), (None, "double_layer", "constant_charge")
    ):
        for short in ((), ("born",), ("steric",), ("born", "steric")):
            if attraction or "born" not in short:
                yield (*filter(None, (attraction, layer)), *short)


@pytest.mark.parametrize("names", list(non_contact_combinations()), ids="+".join)
def test_forces_add(names):
    pair_forces = kernels(*names).pair_forces
    for h in gaps("van_der_waals"):
        total = np.array(non_contact_force(h, 1.0, pair_forces))
        alone = np.array([module(name).force(h, 1.0, kernel(name)) for name in names]).reshape(-1, 2)
        assert total == pytest.approx(alone.sum(axis=0), rel=1e-14, abs=1e-14 * np.abs(alone).sum())


@pytest.mark.parametrize("name", PAIR_FORCES)
def test_absent_is_strength_zero(name):
    """To the last bit: the sum with the effect at strength zero is the sum without it."""
    others = [n for n in ("van_der_waals", "double_layer", "steric") if n != effect_of(name)]
    without = kernels(*others).pair_forces
    zero = kernel(name)
    zero = zero._replace(**{zero._fields[0]: 0.0})
    for h in GAPS:
        alone = non_contact_force(h, 1.0, without)
        assert (
            alone
            == non_contact_force(h, 1.0, (*without, zero))
            == non_contact_force(h, 1.0, (zero, *without))
        )


def test_a_contact_law_is_the_one_present():
    for name in CONTACT_LAWS:
        contact = kernels(name).contact
        for h in GAPS:
            assert contact_force(h, 1.0, contact) == module(name).force(h, 1.0, kernel(name))
    assert contact_force(0.0, 1.0, None) == (0.0, 0.0)


def test_compiled_code_holds_nothing_where_the_scene_is_silent():
    assert Kernels((), None, ()) == kernels()
    assert kernels("van_der_waals", "jkr", "rolling") == Kernels(
        (kernel("van_der_waals"),), kernel("jkr"), (kernel("rolling"),)
    )


@pytest.mark.parametrize("name", list(TABLES))
def test_an_effect_takes_all_its_parameters_and_no_others(name):
    complete = effects(name).model_dump(exclude_none=True)
    for key in TABLES[name]:
        tables = {**TABLES, name: {k: v for k, v in TABLES[name].items() if k != key}}
        with pytest.raises(ValidationError, match=rf"{name}.{key}\n|needs {key}|give {key}"):
            Effects.model_validate({n: tables[n] for n in complete})
    with pytest.raises(ValidationError, match=f"{name}.colour"):
        Effects.model_validate({n: TABLES[n] | ({"colour": 1} if n == name else {}) for n in complete})
