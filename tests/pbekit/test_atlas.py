"""The atlas: counts add, parts of other groups are refused, what is not known is not made up."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pbe_synthetic import RADIUS, SHEAR_RATE, design
from typer.testing import CliRunner

from pbekit import Atlas, KernelTable, PBEError
from pbekit.commands.main import app
from pbekit.tables.atlas import SHIPPED, Part
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED, UNRESOLVED

LARGEST_FILE = 200_000
"""Bytes."""


def table_of(cohesion: float, seed: int, strength: float = 1.0, **about) -> KernelTable:
    groups = {
        "cohesion_number": (cohesion, 1.0, 1.0),
        "van_der_waals.strength": (strength / cohesion, -3.0, -1.0),
    }
    known = {"viscosity": 1.0, "groups": json.dumps(groups), "runs": f"run-{seed}.nc", "seed": seed, **about}
    return KernelTable.of(
        design(np.random.default_rng(seed), 2000, 12), RADIUS, SHEAR_RATE, shapes=1, about=known
    )


@pytest.fixture(scope="module")
def atlas():
    found = Atlas(())
    for cohesion, seed in ((0.6, 1), (0.4, 2), (0.4, 3)):
        found = found.merged(Part.of(table_of(cohesion, seed)))
    return found


def test_counts_are_those_of_the_encounters(atlas):
    for size_i, size_j in ((1, 1), (3, 2), (7, 5)):
        k = n = 0
        for seed in (2, 3):
            r = table_of(0.4, seed).records
            pair = np.all(np.sort(r.size, axis=1) == sorted((size_i, size_j)), axis=1)
            n += int((pair & (r.outcome != UNRESOLVED)).sum())
            k += int((pair & (r.outcome == AGGREGATION)).sum())
        found = atlas.probability(size_i, size_j, 0.4)
        assert (found.seen, found.trials) == (k, n) and found.low <= k / n <= found.high


def test_the_file_gives_back_what_was_saved(atlas, tmp_path):
    atlas.save(tmp_path / "atlas.nc")
    again = Atlas.load(tmp_path / "atlas.nc")
    for one, other in zip(atlas.parts, again.parts, strict=True):
        np.testing.assert_array_equal(one.counts, other.counts)
        assert one.cohesion == other.cohesion and dict(one.origin) == dict(other.origin)
        assert not one.unlike(other)


def test_between_cohesion_numbers_it_lies_between(atlas):
    ends = [atlas.probability(2, 3, n).value for n in (0.4, 0.6)]
    found = atlas.probability(2, 3, 0.5)
    assert min(ends) * 0.95 <= found.value <= max(ends) * 1.05 and found.low < found.value < found.high


def test_what_is_not_known_is_refused(atlas):
    with pytest.raises(PBEError, match=r"N = 0\.9: expected one from the atlas' \(0\.4, 0\.6\)"):
        atlas.probability(1, 1, 0.9)
    with pytest.raises(PBEError, match="no encounter of 1 and 300 primaries"):
        atlas.probability(1, 300, 0.4)


def test_parts_that_do_not_belong_are_refused(atlas):
    with pytest.raises(PBEError, match=r"holds the encounters of run-3\.nc at N = 0\.4 already"):
        atlas.merged(Part.of(table_of(0.4, 3)))
    with pytest.raises(PBEError, match=r"other groups: van_der_waals\.strength"):
        atlas.merged(Part.of(table_of(0.5, 9, strength=1.1)))
    table = table_of(0.4, 4)
    with pytest.raises(PBEError, match="shapes by outer radius"):
        Part.of(replace(table, shape_name="outer radius"))


def test_the_atlas_that_comes_with_the_package():
    """Every part says where it is from; it is small, and its eta_11 follows the law's power of N within its errors."""
    shipped = Atlas.load()
    assert Path(SHIPPED).stat().st_size < LARGEST_FILE
    assert all(
        part.encounters > 0 and {"scene", "runs", "seed"} <= part.origin.keys() for part in shipped.parts
    )
    assert sum(part.encounters for part in shipped.parts) > 700_000
    numbers = shipped.cohesion_numbers
    assert numbers[0] < 0.26 and numbers[-1] > 0.85
    broken = [shipped.probability(14, 14, n, SCATTERED).value for n in numbers[:-1]]
    assert np.all(np.diff(broken) > 0)
    # None as heavy lives that long in the strongest flow.
    with pytest.raises(PBEError, match="nothing is known of them"):
        shipped.probability(14, 14, numbers[-1], SCATTERED)


def test_the_command_prints_numbers_with_what_is_behind_them():
    done = CliRunner().invoke(app, ["efficiency", "1", "1", "--cohesion", "0.4255319148936170"])
    assert done.exit_code == 0 and "encounters aggregated" in done.output
    eta = float(done.output.split()[2])
    assert 0.05 < eta < 0.09
    refused = CliRunner().invoke(app, ["efficiency", "1", "1", "--cohesion", "2"])
    assert refused.exit_code == 2 and "beyond them nothing is known" in refused.output
