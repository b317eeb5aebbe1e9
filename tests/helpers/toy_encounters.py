"""Encounters that take no time: real geometry, conserved primaries, outcomes by a made-up rule.

They feed figures and reports with every outcome and with all kinds of shapes; no number of theirs means anything.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import EncounterResult, classify
from mcdem.quantities.linear_flows import draw_offset

CRITICAL = 22


def capped(rng, centres, count):
    """Primaries added one by one (unit radius), each touching three: isostatic when it began so."""
    x = np.zeros((count, 3))
    n = len(centres)
    x[:n] = centres
    while n < count:
        i = rng.integers(n)
        away = ((x[:n] - x[i]) ** 2).sum(axis=1)
        near = np.flatnonzero((away > 0) & (away < 15.9))
        if n < 3 or len(near) < 2 or rng.random() < 0.01:  # now and then a loose end
            along = rng.normal(size=3)
            spot = x[i] + 2.0 * along / np.sqrt(along @ along)
        else:
            j, k = rng.choice(near, 2, replace=False)
            b, c = x[j] - x[i], x[k] - x[i]
            normal = np.cross(b, c)
            area = normal @ normal
            if area < 1e-6:
                continue
            foot = np.cross((b @ b) * c - (c @ c) * b, normal) / (2 * area)
            height = 4 - foot @ foot
            if height < 0:
                continue
            spot = x[i] + foot + rng.choice([-1, 1]) * np.sqrt(height / area) * normal
        if ((spot - x[:n]) ** 2).sum(axis=1).min() > 4 - 1e-8:
            x[n] = spot
            n += 1
    return x


def contacts(centres):
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    return (np.abs(gaps - 2) < 1e-6) & ~np.eye(len(centres), dtype=bool)


def toy_encounter(scene, first, second, offset=None, seed=None, **_):
    rng = np.random.default_rng(seed)
    a, rate = scene.suspension.radius, scene.flow.shear_rate
    reach = first.outer_radius(a) + second.outer_radius(a)
    offset = draw_offset(scene.flow, reach, rng) if offset is None else offset
    hit = rng.random() < 0.9 * (1 - np.hypot(*offset) / reach)
    total = first.size + second.size
    contact, bond_loss, tension = hit, np.nan, 0.3e-8 * rng.gamma(3.0) * total / 30
    if not hit:
        members = [np.arange(first.size), np.arange(first.size, total)]
        products = [first, second]
    else:
        centres = capped(rng, first.positions / a, total)
        bonded = contacts(centres)
        breaks = rng.random() < 1 / (1 + (CRITICAL * 1000 / scene.flow.shear_stress / total) ** 6)
        if breaks:
            bond_loss = 1e-4 + rng.exponential(3.0) / rate
            axis = np.linalg.eigh(np.cov(centres.T))[1][:, 2]
            along = (centres - centres.mean(axis=0)) @ axis
            cuts = [np.quantile(along, 0.05 if rng.random() < 0.1 else rng.uniform(0.4, 0.6))]
            if rng.random() < 0.2:
                cuts.append(np.quantile(along, 0.9))
            side = np.searchsorted(cuts, along)
            bonded &= side[:, None] == side[None]
            tension = 1.05e-8
        count, label = connected_components(bonded)
        members = [np.flatnonzero(label == part) for part in range(count)]
        products = [Aggregate.from_contacts(a * centres[m], bonded[np.ix_(m, m)]) for m in members]
    outcome = classify(tuple(members), first.size, contact)
    return EncounterResult(
        outcome=outcome,
        products=tuple(products),
        members=tuple(members),
        centres=np.zeros((len(products), 3)),
        offset=(float(offset[0]), float(offset[1])),
        contact=bool(contact),
        simulated_time=1e-2,
        first_contact_time=1e-4 if contact else np.nan,
        last_bond_change_time=bond_loss,
        first_bond_loss_time=bond_loss,
        largest_tension=float(tension),
        smallest_gap=0.0,
        steps=300,
        solves=300,
        cpu_time=0.0,
    )
