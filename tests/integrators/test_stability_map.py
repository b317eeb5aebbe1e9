"""The stability map: it finds limits that are known, and its table is what the command makes."""

from __future__ import annotations

import json
import math

import pytest

from mcdem.scene import load_scene
from validation import stability_map
from validation.hard_cases.case import PAPER


def test_bisection_finds_a_known_limit():
    step, fails = stability_map.largest_step(lambda step: step < 0.37, 1e-3, 10.0)
    assert 0.37 / stability_map.RESOLUTION <= step < 0.37 and fails
    assert stability_map.largest_step(lambda step: True, 1e-3, 10.0) == (10.0, False)
    step, fails = stability_map.largest_step(lambda step: False, 1e-3, 10.0)
    assert math.isnan(step) and fails


def test_a_contact_under_explicit_steps_fails_where_theory_says():
    """Beyond 2/(k m) the distance from rest grows at every step, short of it it falls."""
    scene = stability_map.SWEEPS["elastic_modulus"].at(load_scene(PAPER), 1e11)
    limit = stability_map.predicted_contact(scene)
    euler, implicit = (stability_map.WAYS[name] for name in ("euler", "implicit"))
    assert stability_map.contact_holds(euler.at(scene, 0.95 * limit), 0.95 * limit)
    assert not stability_map.contact_holds(euler.at(scene, 1.05 * limit), 1.05 * limit)
    assert stability_map.contact_holds(implicit.at(scene, 100.0 * limit), 100.0 * limit)


def test_a_landing_and_a_turn_fail_beyond_their_limits():
    scene = stability_map.SWEEPS["elastic_modulus"].at(load_scene(PAPER), 1e10)
    euler = stability_map.WAYS["euler"]
    for name in ("snap_in", "turning"):
        motion = stability_map.MOTIONS[name]
        limit = motion.predicted(scene)
        assert motion.holds(euler.at(scene, 0.8 * limit), 0.8 * limit), name
        assert not motion.holds(euler.at(scene, 1.5 * limit), 1.5 * limit), name


def test_a_compressed_contact_is_stiffer_and_its_limit_shorter():
    """79 N/m under 5 F_adh against 41.9 N/m without load, by the JKR law of the paper's spheres."""
    scene = load_scene(PAPER)
    ratio = stability_map.predicted_contact(scene, 5.0) / stability_map.predicted_contact(scene)
    assert ratio == pytest.approx(41.9 / 79.0, rel=2e-2)


def test_the_crossing_is_read_off_a_power_law():
    rows = [
        {
            "parameter": "viscosity",
            "scheme": "euler",
            "value": x,
            "largest_step": 2e-5 * x,
            "motion": "contact",
        }
        for x in (1e-3, 1e-2, 1e-1, 1.0)
    ]
    assert stability_map.crossing(rows, "viscosity") == pytest.approx(0.05)
    assert math.isnan(stability_map.crossing(rows[:2], "viscosity"))


def test_what_is_kept_is_whole_and_can_be_drawn():
    kept = json.loads(stability_map.KEPT.read_text())
    assert kept["command"] == stability_map.COMMAND
    expected = {
        (motion, parameter, value, scheme)
        for motion, what in stability_map.MOTIONS.items()
        for parameter, sweep in stability_map.SWEEPS.items()
        for value in sweep.values
        for scheme in what.schemes
    }
    assert {(r["motion"], r["parameter"], r["value"], r["scheme"]) for r in kept["rows"]} == expected
    figure = stability_map.draw(kept["rows"])
    assert len(figure.axes) == 9
