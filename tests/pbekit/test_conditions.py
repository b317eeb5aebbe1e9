"""A table at other dimensional conditions: the same dimensionless course, or a refusal that says what would keep it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pbe_synthetic import RADIUS, SHEAR_RATE, design
from typer.testing import CliRunner

from mcdem import load_scene
from mcdem.analysis.similarity import groups
from pbekit import Conditions, KernelTable, PBEError, solve_table
from pbekit.commands.main import app
from pbekit.export import export_table, hand_over
from pbekit.scenes import conditions_of_scene
from pbekit.tables.similarity import at_conditions, groups_at, rescaled

LARGEST, PHI, VISCOSITY = 12, 1e-2, 2.0
OPTIONS = {"volume_fraction": PHI, "exact_to": LARGEST, "largest": LARGEST, "samples": 21}


def table_of(cohesion: float, seed: int = 1, critical: float = 7.0, **about) -> KernelTable:
    """Of adhesion forces in proportion to the radius, as of elastic spheres: N ~ mu g a."""
    groups = {
        "cohesion_number": (cohesion, 1.0, 1.0),
        "van_der_waals.minimum_approach": (3e-4, -1.0, 0.0),
    }
    return KernelTable.of(
        design(np.random.default_rng(seed), 3000, LARGEST, critical=critical, pieces=3),
        RADIUS,
        SHEAR_RATE,
        size_edges=np.arange(1, LARGEST + 2),
        shapes=1,
        about={"viscosity": VISCOSITY, "volume_fraction": PHI, "groups": json.dumps(groups), **about},
    )


def test_equal_groups_give_the_same_dimensionless_course():
    """At a third of the radius and seven times the rate, N kept by the viscosity: <P> over g t, n a^3 and d32/a."""
    table = table_of(0.4)
    there = Conditions(RADIUS / 3, VISCOSITY * 3 / 7, 7 * SHEAR_RATE)
    here = solve_table(table, until=200.0, **OPTIONS)
    found = solve_table(table, conditions=there, until=200.0 / 7, **OPTIONS)
    np.testing.assert_allclose(found.mean_size, here.mean_size, rtol=1e-9)
    np.testing.assert_allclose(
        found.number / 27, here.number, rtol=1e-6, atol=1e-9 * float(here.number.max())
    )
    np.testing.assert_allclose(3 * found.sauter_diameter, here.sauter_diameter, rtol=1e-9)
    assert found.attrs["steady_mean_size"] == pytest.approx(here.attrs["steady_mean_size"], rel=1e-9)
    # What of the same material differs there is said.
    assert "van_der_waals.minimum_approach would be 0.0009" in found.attrs["assumed"]
    assert "not measured" in found.attrs["assumed"]


def test_what_differs_is_weighed_where_its_weight_was_measured():
    table = table_of(0.4, sensitivities=json.dumps({"van_der_waals.minimum_approach": {"eta_11": -0.5}}))
    _, _, lines = at_conditions([table], Conditions(RADIUS / 4, 4 * VISCOSITY, SHEAR_RATE))
    assert any("eta_11 goes with its power -0.5, so by a factor of 0.5" in line for line in lines)


def test_another_cohesion_number_is_refused_with_what_would_keep_it():
    table = table_of(0.4)
    with pytest.raises(PBEError, match=r"N = 0\.2 .* expected 0\.4; a shear rate of 2 1/s keeps it"):
        at_conditions([table], Conditions(RADIUS / 2, VISCOSITY, SHEAR_RATE))
    # Whose contacts hold half as much has the table's N there.
    moved, stress, _ = at_conditions([table], Conditions(RADIUS / 2, VISCOSITY, SHEAR_RATE, cohesion=0.4))
    assert stress is None and moved[0].radius == RADIUS / 2
    with pytest.raises(PBEError, match="older version"):
        groups_at(
            KernelTable.of(table.records, RADIUS, SHEAR_RATE, about={"viscosity": 1.0}), Conditions(1, 1, 1)
        )


def test_between_cohesion_numbers_is_between_stresses():
    """The same viscosities twofold: interpolated in N at the radius of the tables, and in stress."""
    low, high = table_of(0.4, critical=8.0), table_of(0.6, 2, critical=6.0)
    in_n = solve_table(
        [low, high], conditions=Conditions(RADIUS, 1.25 * VISCOSITY, SHEAR_RATE), until=50.0, **OPTIONS
    )
    high = rescaled(high, Conditions(RADIUS, 1.5 * VISCOSITY, SHEAR_RATE))
    in_stress = solve_table([low, high], stress=1.25 * VISCOSITY * SHEAR_RATE, until=50.0, **OPTIONS)
    np.testing.assert_allclose(in_n.mean_size, in_stress.mean_size, rtol=1e-9)
    with pytest.raises(PBEError, match=r"between those of the tables \(0\.4, 0\.6\)"):
        solve_table([low, high], conditions=Conditions(RADIUS, 2 * VISCOSITY, SHEAR_RATE), until=50.0)


def test_the_command_takes_conditions(tmp_path):
    table_of(0.4).save(tmp_path / "kernels.nc")
    call = ["solve", str(tmp_path / "kernels.nc"), "-o", str(tmp_path / "course.nc"), "--until", "20"]
    done = CliRunner().invoke(app, [*call, "--radius", str(RADIUS / 2), "--shear-rate", "2"])
    assert done.exit_code == 0 and "assumed: N = 0.4" in done.output, done.output
    refused = CliRunner().invoke(app, [*call, "--radius", str(RADIUS / 2), "--overwrite"])
    assert refused.exit_code == 2 and "keeps it for the table's material" in refused.output


def test_an_export_at_other_conditions_has_their_rates(tmp_path):
    """K goes with a^3 g; the page says what is assumed."""
    there = Conditions(RADIUS / 2, VISCOSITY, 2 * SHEAR_RATE)
    options = {"draws": 19, "until": 20.0, "exact_to": LARGEST, "largest": LARGEST}
    table = table_of(0.4)
    here = hand_over(table, **options)
    moved = hand_over(table, conditions=there, **options)
    np.testing.assert_allclose(
        4 * moved.rates.aggregation_rate.value, here.rates.aggregation_rate.value, rtol=1e-9
    )
    export_table(moved, "csv", tmp_path)
    assert "van_der_waals.minimum_approach would be" in (tmp_path / "README.md").read_text()


# -- a scene ------------------------------------------------------------------------------------------------------------

SCENE = Path(__file__).parents[2] / "scenes" / "quickstart.toml"


def table_of_scene(**about) -> KernelTable:
    """A synthetic table that says the groups and conditions of the quickstart."""
    scene = load_scene(SCENE)
    a, g = scene.suspension.radius, scene.flow.shear_rate
    made = {
        "viscosity": scene.flow.viscosity,
        "volume_fraction": PHI,
        "groups": json.dumps(groups(scene)),
        **about,
    }
    table = table_of(0.4)
    return KernelTable.of(
        table.records.scaled(a / RADIUS, SHEAR_RATE / g), a, g,
        size_edges=np.arange(1, LARGEST + 2), shapes=1, about=made,
    )  # fmt: skip


def scene_with(tmp_path, *changes: tuple[str, str]) -> Path:
    text = SCENE.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return path


def test_a_scene_gives_the_conditions_and_its_own_groups(tmp_path):
    """The table's own scene: nothing differs; another Hamaker constant alone: the attraction is named, at its weight."""
    power = 0.2
    table = table_of_scene(sensitivities=json.dumps({"attraction_number": {"eta_11": power}}))
    conditions, share = conditions_of_scene(SCENE)
    assert (conditions.radius, share) == (table.radius, 1e-4)
    (moved,), _, lines = at_conditions([table], conditions)
    assert len(lines) == 1 and lines[0].startswith("N = 0.4255") and lines[0].endswith("of the scene")
    assert moved.radius == table.radius
    stronger = scene_with(tmp_path, ("0.97e-20 J", "1.94e-20 J"))
    _, _, lines = at_conditions([table], conditions_of_scene(stronger)[0])
    (named,) = [line for line in lines if line.startswith("attraction_number")]
    assert f"by a factor of {2**power:.2g}" in named
    bare = {k: v for k, v in groups(load_scene(SCENE)).items() if not k.startswith("van_der_waals")}
    for effects in (bare, {**bare, "double_layer.strength": (0.1, 1.0, 0.0)}):
        _, _, lines = at_conditions([table_of_scene(groups=json.dumps(effects))], conditions)
        alone = [line.split()[0] for line in lines if "of the scene alone" in line]
        assert alone and all(name.startswith("van_der_waals.") for name in alone)
    assert any(line.startswith("double_layer.strength is of the table alone") for line in lines)


def test_a_scene_of_another_cohesion_number_is_refused_with_what_gives_it_the_tables(tmp_path):
    table = table_of_scene()
    slower = scene_with(tmp_path, ('"1e4 1/s"', '"8e3 1/s"'))
    with pytest.raises(PBEError, match="a shear rate of 10000 1/s gives the scene the table's"):
        at_conditions([table], conditions_of_scene(slower)[0])


def test_a_file_that_is_no_scene_is_refused_in_one_line(tmp_path):
    with pytest.raises(PBEError, match="radius"):
        conditions_of_scene(scene_with(tmp_path, ('radius = "500 nm"', 'radius = "500 Pa"')))
    turning = scene_with(
        tmp_path, ('"simple_shear"', '"uniaxial"'), ('shear_rate = "1e4 1/s"', 'extension_rate = "1e4 1/s"')
    )
    with pytest.raises(PBEError):
        conditions_of_scene(turning)


def test_commands_take_a_scene(tmp_path):
    table_of_scene().save(tmp_path / "table.nc")
    asked = ["solve", str(tmp_path / "table.nc"), "-o", str(tmp_path / "balance.nc"), "--scene", str(SCENE)]
    asked += ["--until", "1 s", "--largest", str(LARGEST), "--exact-to", str(LARGEST)]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    with xr.open_dataset(tmp_path / "balance.nc") as data:
        radius = load_scene(SCENE).suspension.radius
        assert float(data.number[0] @ data.mass) == pytest.approx(
            1e-4 / (4 / 3 * np.pi * radius**3), rel=1e-9
        )
        assert "of the scene" in data.attrs["assumed"]
    done = CliRunner().invoke(app, [*asked, "--overwrite", "--radius", "1e-7"])
    assert isinstance(done.exception, PBEError) or "give one of them" in done.output
    exported = CliRunner().invoke(
        app,
        ["export", str(tmp_path / "table.nc"), "--to", "csv", "-o", str(tmp_path / "out"), "--scene", str(SCENE),
         "--until", "1 s", "--draws", "19", "--largest", str(LARGEST), "--exact-to", str(LARGEST)],
    )  # fmt: skip
    assert exported.exit_code == 0, exported.output
    assert "of the scene" in (tmp_path / "out" / "README.md").read_text()
