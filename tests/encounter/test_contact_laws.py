"""Whatever shows contacts does so for every law of a contact, not for the paper's alone."""

from __future__ import annotations

import numpy as np
import pytest
from effects_family import CONTACT_LAWS, scene

from mcdem.aggregates.shapes import straight_chain
from mcdem.effects.sums import contact_equilibrium
from mcdem.encounter.simulate import Recorder
from mcdem.encounter.trajectory import Trajectory
from mcdem.figures.forces import pair_force

every_law = pytest.mark.parametrize("law", CONTACT_LAWS)


@every_law
def test_a_trajectory_knows_what_its_contacts_bear(law):
    whole = scene("van_der_waals", law)
    strength = whole.effects.contact.pull_off_force(whole.suspension.radius)
    assert Trajectory.of_encounter(whole, Recorder()).pull_off_force == strength > 0.0
    assert np.isnan(Trajectory.of_encounter(scene("steric"), Recorder()).pull_off_force)


@every_law
def test_a_straight_chain_is_in_contact_at_rest(law):
    whole = scene(law)
    chain = straight_chain(whole, 3)
    gaps = np.diff(np.sort(chain.positions[:, 2])) / whole.reduced.length - 2.0
    assert len(chain.bonds) == 2
    assert gaps == pytest.approx(contact_equilibrium(1.0, whole.kernels.contact)[0], abs=1e-12)


@every_law
def test_the_figure_of_the_pair_force_shows_the_law_of_the_scene(law):
    whole = scene("van_der_waals", law)
    figure = pair_force(whole)
    numbers, strength = figure.numbers, whole.effects.contact.pull_off_force(whole.suspension.radius)
    assert whole.effects.contact.title in figure.caption
    assert float(numbers["force_attached"].min()) == pytest.approx(-strength, rel=1e-12)
    at_rest = np.interp(numbers["equilibrium_gap"], numbers["gap_attached"], numbers["force_attached"])
    assert abs(at_rest) < 1e-3 * strength
