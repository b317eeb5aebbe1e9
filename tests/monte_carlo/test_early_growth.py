"""The first growth of a suspension of free primaries against Eq. 22 at the efficiency that the very encounters have.

Frungieri & Vanni (2021), Eq. 22: d<P>/dt = (4/pi) eta_11 phi g at t = 0.  The same efficiency comes once from
critical offsets (`mcdem.pair_efficiency`) and once from the process, so this holds pair selection, rates, volume,
offsets and encounters together.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

import mcdem
from mcdem.monte_carlo import run_control

ENCOUNTERS = 2500
"""About 180 captures: the rate is then known to 7.5 % (one standard deviation)."""
PRIMARIES = 4000
"""Enough that hardly an encounter meets anything but two primaries (<P> ends near 1.05)."""


def test_early_slope_is_eq_22_at_the_efficiency_of_the_pair(tmp_path):
    """Within 3.3 standard deviations of the count of captures: a false alarm in a thousand runs with other seeds."""
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes({"population.initial": PRIMARIES})
    path = tmp_path / "early.nc"
    run_control.run(scene, path, seed=11, events=ENCOUNTERS)
    with xr.open_dataset(path, group="events") as data:
        time, sizes = data["time"].values, data["parent_size"].values
        outcomes = np.array(data["outcome"].attrs["flag_meanings"].split())[data["outcome"].values]
    monomers, captures, exposure, last = PRIMARIES, 0, 0.0, 0.0
    for now, pair, outcome in zip(time, sizes, outcomes, strict=True):
        exposure += monomers * (monomers - 1) * (now - last)
        last = now
        if outcome == "aggregation":
            captures += int((pair == 1).all())
            monomers -= int((pair == 1).sum())
    found = mcdem.pair_efficiency(scene)
    expected = (4.0 / math.pi) * found.efficiency * scene.suspension.volume_fraction * scene.flow.shear_rate
    slope = captures * (PRIMARIES - 1) / exposure
    error = math.hypot(slope / math.sqrt(captures), expected * found.error / found.efficiency)
    print(
        f"d<P>/dt = {slope:.4f} +- {error:.4f} 1/s, Eq. 22 at eta_11 = {found.efficiency:.4f}: {expected:.4f} 1/s"
    )
    assert captures > 100
    assert abs(slope - expected) < 3.3 * error
