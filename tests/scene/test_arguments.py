"""Public functions take a quantity as a number in SI units, as text or with pint, and refuse the rest in one line."""

from __future__ import annotations

import math
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from pint import UnitRegistry
from typer.testing import CliRunner

import mcdem
from mcdem.aggregates.aggregate import Aggregate
from mcdem.commands.main import app
from mcdem.effects import DoubleLayer, Effects
from mcdem.effects.jkr import JKR
from mcdem.effects.van_der_waals import VanDerWaals
from mcdem.encounter import static_strength as strength
from mcdem.errors import SceneError, UserError
from mcdem.monte_carlo.run_control import run
from mcdem.quantities import units
from mcdem.quantities.unit_factors import PREFIXED, known_units, si_unit
from mcdem.scene import Flow, Run, Scene, Suspension

PAPER = Path(__file__).parents[2] / "scenes" / "paper-1000Pa.toml"
SCENE = mcdem.load_scene(PAPER)
RADIUS = SCENE.suspension.radius
MONOMER = Aggregate.monomer()
PAIR = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0 * RADIUS]])


def pint(number, unit):
    return units.unit_registry().Quantity(number, unit)


OWN = UnitRegistry()
"""A registry as users make it, of floats."""


# Three ways to write a quantity, in tables, in changes and in arguments.

WAYS = {
    "SI": (5e-7, 1e4, 0.1, 9.7e-21, 1.65e-10),
    "text": ("500 nm", "1e4 1/s", "100 cP", "0.97e-20 J", "0.165 nm"),
    "pint": (pint(500, "nm"), pint(10, "kHz"), pint("0.1", "Pa*s"), pint("0.97e-20", "J"), pint(0.165, "nm")),
    "pint's own": (OWN("500 nm"), OWN("10 kHz"), OWN("0.1 Pa*s"), OWN("0.97e-20 J"), OWN("0.165 nm")),
}


@pytest.mark.parametrize("way", WAYS)
def test_tables_made_in_python_take_si_text_and_pint(way):
    radius, rate, viscosity, hamaker, roughness = WAYS[way]
    made = Scene(
        suspension=Suspension(radius=radius, volume_fraction=1e-4),
        flow=Flow(shear_rate=rate, viscosity=viscosity),
        effects=Effects(van_der_waals=VanDerWaals(hamaker_constant=hamaker, minimum_approach=roughness)),
    )
    assert made.suspension.radius == 5e-7 and made.flow.shear_stress == pytest.approx(1000.0, rel=1e-15)
    assert made.effects.van_der_waals.minimum_approach == pytest.approx(1.65e-10, rel=1e-15)
    assert Scene.from_text(made.text) == made


@pytest.mark.parametrize("radius", [2.5e-7, "250 nm", pint(0.25, "um"), np.float64(2.5e-7)])
def test_changes_take_si_text_and_pint(radius):
    changed = SCENE.with_changes({"suspension.radius": radius})
    assert changed.suspension.radius == pytest.approx(2.5e-7, rel=1e-15)
    assert (
        SCENE.with_changes(
            {"effects.jkr": {"surface_energy": 4.7e-3, "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}}
        )
        == SCENE
    )


def test_a_file_takes_no_bare_number():
    text = PAPER.read_text().replace('"500 nm"', "5e-7")
    with pytest.raises(
        SceneError, match=r"radius = 5e-07 has no unit; expected a length from 0.1 nm to 1 cm"
    ):
        Scene.from_text(text)
    with pytest.raises(SceneError, match=r"shear_stress = 750.0 has no unit"):
        SCENE.with_changes({"flow.shear_stress": 750.0}, as_in_file=True)


@pytest.mark.parametrize("way", ["SI", "text", "pint"])
def test_arguments_take_si_text_and_pint(way):
    offset = {"SI": (0.0, 2e-7), "text": ("0 nm", "0.2 um"), "pint": (pint(0, "nm"), OWN("200.0 nm"))}[way]
    assert mcdem.simulate_encounter(
        SCENE.with_changes({"numerics.rotations": 0.1}), MONOMER, MONOMER, offset, seed=0
    ).offset == pytest.approx((0.0, 2e-7), rel=1e-15)
    positions = {
        "SI": PAIR,
        "text": [[f"{x!r} m" for x in row] for row in PAIR.tolist()],
        "pint": pint(PAIR * 1e9, "nm"),
    }[way]
    forces = {
        "SI": [[0, 0, 1e-9]] * 2,
        "text": [["0 N", "0 N", "1 nN"]] * 2,
        "pint": pint(np.array([[0, 0, 1.0]] * 2), "nN"),
    }
    ours = mcdem.velocities(SCENE, positions + 0 * positions if way == "SI" else positions, forces[way])
    np.testing.assert_allclose(
        ours.linear, mcdem.velocities(SCENE, PAIR, [[0, 0, 1e-9]] * 2).linear, rtol=1e-9
    )
    assert Aggregate.from_positions(SCENE, positions).bonds.tolist() == [[0, 1]]


# What is refused: the name, what was given, what was expected, on one line.

APART = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]])


def follow(**options):
    given = {"aggregate_i": MONOMER, "aggregate_j": MONOMER, "seed": 0} | options
    return mcdem.simulate_encounter(given.pop("scene", SCENE), **given)


REFUSED = {
    "a path for a scene": (lambda: follow(scene=str(PAPER)), r"scene = .*expected a Scene, as mcdem.load_scene"),
    "an offset of 250 m": (lambda: follow(offset=(0, 250)), r"offset: \(0, 250\) m, expected within 0.001 m"),
    "three offsets": (lambda: follow(offset=(0, 1e-7, 0)), "offset = .*: expected two lengths"),
    "one offset": (lambda: follow(offset=1e-7), "offset = .*: expected two lengths"),
    "text as an offset": (lambda: follow(offset="0 nm 1 nm"), "offset = .*: expected two lengths"),
    "an offset of pressures": (lambda: follow(offset=("0 nm", "1 Pa")), r'offset\[1\] = "1 Pa" has the wrong dimension'),
    "no number as an offset": (lambda: follow(offset=(0.0, math.nan)), r"offset\[1\] = nan is not finite"),
    "a negative seed": (lambda: follow(seed=-1), "seed = -1: expected an integer from 0"),
    "half a seed": (lambda: follow(seed=0.5), "seed = 0.5: expected an integer"),
    "a huge seed": (lambda: follow(seed=2**70), "seed = 1180591620717411303424: expected"),
    "a record of text": (lambda: follow(record="film.mp4"), 'record = "film.mp4": expected a Recorder'),
    "a record without interval": (lambda: follow(record=mcdem.Recorder(interval=0.0)), "record.interval = 0.0: expected"),
    "text for an aggregate": (lambda: follow(aggregate_i="chain"), "aggregate i: positions: .*expected an array"),
    "an aggregate in floats32": (
        lambda: follow(aggregate_j=Aggregate(np.zeros((1, 3), np.float32), np.zeros((0, 2), np.int32))),
        "aggregate j: positions: expected floats",
    ),
    "an aggregate of bonds far apart": (
        lambda: follow(aggregate_i=Aggregate(APART, np.array([[0, 1]], np.int32))),
        "aggregate i: bonds: primaries 0 and 1 are a gap of 2e.03 radii apart",
    ),
    "an aggregate of springs": (
        lambda: follow(aggregate_i=Aggregate(PAIR, np.array([[0, 1]], np.int32), np.zeros((2, 7)))),
        r"aggregate i: springs: expected shape \(1, 7\), found \(2, 7\)",
    ),
    "bonds of three": (lambda: Aggregate.from_positions(SCENE, PAIR, [[0, 1, 0]]), r"bonds: expected whole numbers \(B, 2\)"),
    "bonds of floats": (lambda: Aggregate.from_positions(SCENE, PAIR, [[0.0, 1.0]]), "bonds: expected whole numbers"),
    "ragged bonds": (lambda: Aggregate.from_positions(SCENE, PAIR, [[0, 1], [1]]), "bonds: expected whole numbers"),
    "bonds a millimetre long": (lambda: Aggregate.from_positions(SCENE, APART, [[0, 1]]), "bonds: primaries 0 and 1 are"),
    "bonds of others": (lambda: Aggregate.from_positions(SCENE, PAIR, [[0, 5]]), "bonds: expected pairs of different numbers"),
    "positions in a plane": (lambda: Aggregate.from_positions(SCENE, [[0, 0]]), r"positions: expected an array \(N, 3\)"),
    "positions of pressures": (lambda: Aggregate.from_positions(SCENE, pint(PAIR, "Pa")), "positions: has the wrong dimension"),
    "no positions": (lambda: Aggregate.from_positions(SCENE, np.zeros((0, 3))), "positions: found 0 primaries"),
    "ragged positions": (lambda: Aggregate.from_positions(SCENE, [[0, 0, 0], [1]]), "positions: cannot be read as numbers"),
    "infinite positions": (lambda: Aggregate.from_positions(SCENE, [[0, 0, math.inf]]), r"positions: inf at \(0, 2\)"),
    "a radius of pressure": (lambda: Aggregate.monomer("1 Pa"), 'radius = "1 Pa" has the wrong dimension'),
    "forces of another shape": (lambda: mcdem.velocities(SCENE, PAIR, [[0, 0, 1e-9]]), r"forces: expected an array \(2, 3\)"),
    "a force in metres": (lambda: mcdem.velocities(SCENE, PAIR, [["0 N", "0 N", "1 m"]] * 2), "forces: one of its values has"),
    "a torque of nan": (lambda: mcdem.velocities(SCENE, PAIR, torques=PAIR * math.nan), "torques: nan at"),
    "velocities of a path": (lambda: mcdem.velocities(str(PAPER), PAIR), "expected a Scene"),
    "x0 of pressure": (lambda: mcdem.critical_offset(SCENE, "1 Pa"), 'x0 = "1 Pa" has the wrong dimension'),
    "x0 of text": (lambda: mcdem.critical_offset(SCENE, "left"), 'x0 = "left" is not a number with a unit'),
    "x0 beyond": (lambda: mcdem.critical_offset(SCENE, "3 um"), "x0 = 3e-06 m: expected a length below 2a"),
    "odd rays": (lambda: mcdem.pair_efficiency(SCENE, 3), "rays = 3: expected an even number"),
    "half a ray": (lambda: mcdem.pair_efficiency(SCENE, 2.5), "rays = 2.5: expected an integer"),
    "eta of a path": (lambda: mcdem.pair_efficiency(str(PAPER)), "expected a Scene"),
    "loads of numbers": (lambda: strength.worst_loads(SCENE, [3]), "aggregate 0: positions: expected an array"),
    "a run of a path": (lambda: run(str(PAPER), "x.nc"), "expected a Scene"),
    "a run until a length": (lambda: run(SCENE, "x.nc", until="1 m"), 'until = "1 m" has the wrong dimension'),
    "a run until infinity": (lambda: run(SCENE, "x.nc", until=math.inf), "until = inf is not finite"),
    "a run of half an event": (lambda: run(SCENE, "x.nc", events=0.5), "events = 0.5: expected an integer"),
    "a table of a negative radius": (
        lambda: Suspension(radius=-1.0, volume_fraction=1e-4),
        "Suspension: radius = -1.0 is not positive",
    ),
    "a table with a strange key": (lambda: Run(untill=3.0), 'Run: unknown key "untill"; did you mean "until"'),
    "a table without keys": (lambda: JKR(), 'JKR: key "surface_energy" is missing'),
    "an array for a number": (lambda: Run(until=np.array([1.0, 2.0])), "Run: until = .* is not a number with a unit"),
    "pint of an array": (lambda: Run(until=pint(np.array([1.0, 2.0]), "s")), "Run: until = .* is not one number"),
    "a change that is no value": (lambda: SCENE.with_changes({"run.until": object()}), "run.until = .*expected text with a unit"),
    "pint of a wrong dimension": (
        lambda: SCENE.with_changes({"run.until": pint(1, "m")}),
        r"\[run\] until = .* has the wrong dimension",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused_at_the_door_in_one_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, words = REFUSED[name]
    with pytest.raises(UserError, match=words) as caught:
        call()
    lines = str(caught.value).split("\n")
    assert len(lines) == (3 if name == "a table without keys" else 1)
    assert not list(tmp_path.iterdir())


def test_what_is_taken_at_the_door_is_what_was_meant():
    rng = np.random.default_rng(3)
    brief = SCENE.with_changes({"numerics.rotations": 0.1})
    one = follow(scene=brief, offset=(0.0, 2e-7), seed=rng, orient=False)
    two = follow(scene=brief, offset=["0 um", 2e-7], seed=None, orient=False, aggregate_i=[[0.0, 0.0, 0.0]])
    assert one.outcome == two.outcome and one.smallest_gap == two.smallest_gap
    bonded = Aggregate.from_positions(SCENE, PAIR, np.array([[1, 0]]))
    assert bonded.bonds.tolist() == [[0, 1]] and Aggregate.from_positions(
        SCENE, PAIR[:1], []
    ).bonds.shape == (0, 2)


def test_soft_contacts_hold_far_apart():
    """Contacts of E = 7 MPa and gamma = 0.2 J/m^2 hold over more than 0.15 a; beyond twice their gap none is believed."""
    soft = SCENE.with_changes({"effects.jkr.elastic_modulus": "7 MPa", "effects.jkr.surface_energy": 0.2})
    gap = soft.effects.contact.pull_off_gap(RADIUS) / RADIUS
    assert gap > 0.15
    for stretch, fits in [(0.99 * gap, True), (2.1 * gap, False)]:
        pair = PAIR * (1.0 + 0.5 * stretch)
        if fits:
            assert Aggregate.from_positions(soft, pair, [[0, 1]]).bonds.tolist() == [[0, 1]]
        else:
            with pytest.raises(UserError, match="radii apart"):
                Aggregate.from_positions(soft, pair, [[0, 1]])


# Effects that may be said in more than one way.


def test_salt_and_temperature_stand_for_the_debye_length():
    """1/kappa = 0.304 nm/sqrt(c/M) of a 1:1 salt in water at 25 C (Israelachvili 2011, section 14.7)."""
    rest = {"zeta_potential": "-25 mV", "relative_permittivity": 78.5, "condition": "constant_potential"}
    for concentration, length in [("1 mM", 9.61e-9), ("100 mM", 0.961e-9), ("0.1 mol/L", 0.961e-9)]:
        made = DoubleLayer(salt_concentration=concentration, temperature="25 degC", **rest)
        assert made.debye_length == pytest.approx(length, rel=2e-3)
        assert made.surface_potential == -0.025
    with pytest.raises(SceneError, match=r"give debye_length.* \(found salt_concentration\)"):
        DoubleLayer(salt_concentration="1 mM", **rest)
    with pytest.raises(
        SceneError, match=r"give surface_potential.* \(found surface_potential and zeta_potential\)"
    ):
        DoubleLayer(surface_potential="1 mV", debye_length="5 nm", **rest)


def test_a_changed_key_replaces_those_it_stands_for():
    table = {
        "surface_potential": "-25 mV",
        "debye_length": "10 nm",
        "relative_permittivity": 78.5,
        "condition": "constant_potential",
    }
    charged = SCENE.with_changes({"effects.double_layer": table})
    salted = charged.with_changes(
        {"effects.double_layer.salt_concentration": "1 mM", "effects.double_layer.temperature": "298 K",
         "effects.double_layer.zeta_potential": "-30 mV"}
    )  # fmt: skip
    assert salted.effects.double_layer.surface_potential == -0.03
    assert salted.effects.double_layer.debye_length == pytest.approx(9.6e-9, rel=2e-3)
    back = {"effects.double_layer.debye_length": 1e-8, "effects.double_layer.surface_potential": "-25 mV"}
    assert salted.with_changes(back) == charged
    mixed = SCENE.with_changes(
        {"suspension.radii": ["500 nm", 250e-9], "suspension.number_fractions": [0.5, 0.5]}
    )
    assert mixed.with_changes({"suspension.radius": "500 nm"}) == SCENE


def test_a_missing_surface_energy_is_offered():
    text = PAPER.read_text().replace('surface_energy = "4.7e-3 J/m^2"\n', "")
    with pytest.raises(
        SceneError, match=r'such as "4.7 mJ/m\^2"; A_H/\(24 pi l0\^2\) .* is "0.00473 J/m\^2"'
    ):
        Scene.from_text(text)
    text = text.replace('minimum_approach = "0.165 nm"\n', "")
    with pytest.raises(SceneError, match=r"or A_H/\(24 pi l0\^2\), with Hamaker constant"):
        Scene.from_text(text)


# Changes are made together.


def test_two_of_the_flow_that_are_changed_together_stay():
    for changes in [
        {"flow.shear_stress": "750 Pa", "flow.viscosity": "1 cP"},
        {"flow.viscosity": "1 cP", "flow.shear_stress": "750 Pa"},
    ]:
        assert SCENE.gives_way(changes) == [("flow", "shear_rate")]
        flow = SCENE.with_changes(changes).flow
        assert (flow.shear_stress, flow.viscosity) == (750.0, 1e-3) and flow.shear_rate == pytest.approx(
            7.5e5
        )


@pytest.mark.parametrize("one", ["shear_rate", "viscosity", "shear_stress"])
@pytest.mark.parametrize("other", ["shear_rate", "viscosity", "shear_stress"])
def test_what_is_changed_is_what_the_scene_says(one, other):
    """For every pair, from every scene that has two others: the named stay, in either order."""
    values = {"shear_rate": 500.0, "viscosity": 0.02, "shear_stress": 30.0}
    for start in [{"flow.shear_stress": 1000.0}, {"flow.viscosity": 0.1, "flow.shear_stress": 1000.0}, {}]:
        scene = SCENE.with_changes(start)
        changes = {f"flow.{key}": values[key] for key in (one, other)}
        flow = scene.with_changes(changes).flow
        assert all(getattr(flow, key) == pytest.approx(values[key], rel=1e-15) for key in (one, other))
        assert flow.shear_stress == pytest.approx(flow.shear_rate * flow.viscosity)
    assert {key for _, key in SCENE.gives_way({"flow.shear_stress": "1 Pa"})} == {"viscosity"}


def test_three_of_the_flow_are_refused_as_in_a_file():
    with pytest.raises(SceneError, match="give exactly two of shear_rate, viscosity and shear_stress"):
        SCENE.with_changes({"flow.shear_stress": 1.0, "flow.viscosity": 1.0, "flow.shear_rate": 1.0})


def test_the_order_of_changes_means_nothing():
    changes = {"effects.jkr": None, "effects.dmt.surface_energy": 4.7e-3, "effects.dmt.poisson_ratio": 0.3,
               "effects.dmt.elastic_modulus": 3.4e9, "flow.shear_stress": "20 Pa"}  # fmt: skip
    backwards = dict(reversed(changes.items()))
    assert SCENE.with_changes(changes) == SCENE.with_changes(backwards)
    with pytest.raises(SceneError, match="and the table it is in"):
        SCENE.with_changes({"effects.jkr.poisson_ratio": 0.3, "effects.jkr": None})


# Units.


def test_units_are_read_by_the_factors_of_pint():
    """Exactly; and a text is the same float as by way of pint, products and quotients too."""
    registry, draws = units.unit_registry(), np.random.default_rng(5)
    base = ("meter", "kilogram", "second", "kelvin", "mole", "ampere")
    for name in known_units() - {"degC", "°C", "celsius"}:
        factor, dimension = si_unit(((name, 1),))
        theirs = registry.Quantity(Decimal(1), units._unit(name)).to_base_units()
        assert Decimal(theirs.magnitude) == factor, name
        assert dict(theirs.units._units) == {unit: n for unit, n in zip(base, dimension, strict=True) if n}, (
            name
        )
        for text in (
            f"{draws.uniform():.7f}e{draws.integers(-9, 9)} {given}"
            for given in (name, f"1/{name}", f"s {name}^2")
        ):
            powers = units._powers(text.partition(" ")[2])
            wanted = " ".join(
                f"{unit}^{n}"
                for unit, n in zip(("m", "kg", "s", "K", "mol", "A"), si_unit(powers).dimension, strict=True)
                if n
            )
            assert units._read_by_factor(text, wanted) == float(
                units._read(text).m_as(units._unit(wanted))
            ), text
    assert si_unit((("degC", 1),)) is None


def test_every_known_unit_is_what_it_seems():
    """A prefix and a unit are the power of ten times the unit, for all of them; none is another unit of pint's."""
    powers = dict(
        zip(
            "f p n u µ μ m c d k M G T".split(),
            (-15, -12, -9, -6, -6, -6, -3, -2, -1, 3, 6, 9, 12),
            strict=True,
        )
    )
    registry = units.unit_registry()
    for unit in PREFIXED:
        one = registry.Quantity(1, unit).to_base_units()
        for prefix, power in powers.items():
            scaled = registry.Quantity(1, prefix + unit).to_base_units()
            assert scaled.units == one.units
            assert float(scaled.magnitude / one.magnitude) == pytest.approx(10.0**power, rel=1e-12), (
                prefix + unit
            )
    for name in known_units():
        assert float(units._unit(name) is not None)


@pytest.mark.parametrize(
    "text",
    [
        "5 nm # thousand",
        "5\0nm",
        "5 B",
        "5 nm nm",
        "5 nm/",
        "5 * nm",
        "nm",
        "5,5 nm",
        "٥ nm",
        "5\nnm",
        "5 nm^99",
    ],
)
def test_what_stands_after_a_unit_is_refused(text):
    with pytest.raises(ValueError, match="expected a length"):
        units.LENGTH.to_si(text)


@pytest.mark.parametrize(
    "text", ["4.7 mJ/m^2", "4.7 mJ/m²", "4.7 mJ/m2", "4.7 mJ m^-2", "4.7 mJ·m⁻²", "4.7 mN/m", "4.7e-3 kg/s^2"]
)
def test_ways_to_write_a_surface_energy(text):
    assert units.SURFACE_ENERGY.to_si(text) == pytest.approx(4.7e-3, rel=1e-15)


# Options of commands.

OPTIONS = {
    "encounter SCENE --first " + "9" * 5000: "--first 99999",
    "encounter SCENE --first 0": "--first 0: expected 1 to 1000 primaries",
    "encounter SCENE --offset 0nm 250m": "offset: (0, 250) m, expected within 0.001 m",
    "encounter SCENE --offset 0 1nm": '--offset "0" has no unit',
    "encounter SCENE --every nan": "--every",
    "encounter SCENE --seed -1": "--seed",
    "efficiency SCENE --cutoff " + "x" * 5000: "expected numbers between commas",
    "efficiency SCENE --cutoff nan": "expected gaps over the radius",
    "cost SCENE --error inf": "inf is not a finite number",
    "run SCENE --until 1e300s": '--until "1e300s" is out of bounds',
    "run SCENE --events 999999999999999999999999": "--events",
    "run SCENE --seed 99999999999999999999": "--seed",
    "sweep SCENE --replicas 9999999": "replicas = 9999999: expected an integer from 1 to 10000",
    "sensitivity SCENE --set flow.viscosity=1": "viscosity = 1 has no unit",
    "check " + "x" * 5000: "cannot be read: File name too long",
}


@pytest.mark.parametrize("line", OPTIONS, ids=lambda line: line[:40])
def test_options_that_cannot_be_meant_are_refused(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [str(PAPER) if word == "SCENE" else word for word in line.split()])
    said = " ".join(done.output.replace("│", " ").split())
    assert done.exit_code == 2 and OPTIONS[line] in said and len(said) < 800, said
    assert not list(tmp_path.iterdir())
