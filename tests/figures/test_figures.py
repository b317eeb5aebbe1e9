"""Every figure is drawn, from numbers that are saved beside it and suffice to draw it again."""

from dataclasses import replace
from functools import cache

import effects_family
import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import StepPatch
from overlaps import overlaps
from PIL import Image
from small_runs import small_runs
from trimer import turning_trimer
from typer.testing import CliRunner

from mcdem.analysis.breakup import CONVENTIONS, in_convention
from mcdem.analysis.dataset import RunDataset
from mcdem.commands.main import app
from mcdem.effects.sums import non_contact_force
from mcdem.encounter import trajectory
from mcdem.figures import bonds, breakup, draw_all, figures_of, growth, look, pair_force, plot_run, style
from mcdem.figures.encounter import moments

PAPER = {"fig05", "fig06a", "fig06b", "fig07", "fig08a", "fig08b", "fig09", "fig10", "fig11"}
PAPER |= {"fig12a", "fig12b", "fig13", "fig14", "fig15", "fig16", "table2"}
NEW = {"isostaticity", "outcome_offset", "first_bond_loss", "bond_tension"}


@pytest.fixture(scope="module", autouse=True)
def small_pictures():
    """Print's resolution takes its time, and shows nothing here that a screen's does not."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(style.RC, "savefig.dpi", 60)
        yield


@pytest.fixture(scope="module")
def album(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    trajectory.write(turning_trimer(), folder / "encounter.nc")
    list(draw_all([*small_runs(), folder / "encounter.nc"], folder / "out"))
    return folder / "out"


def test_every_figure_of_the_paper_and_the_new_ones_are_there(album):
    names = {path.stem for path in album.glob("*.png")}
    assert {name.split("_")[0] for name in names} >= PAPER
    assert all(any(name.startswith(new) for name in names) for new in NEW)
    for path in album.glob("*.png"):
        picture = np.asarray(Image.open(path).convert("L"))
        assert picture.std() > 5, f"{path.name} is blank"


def test_numbers_lie_beside_and_carry_units(album):
    for path in album.glob("*.png"):
        with xr.open_dataset(path.with_suffix(".nc"), decode_times=False) as numbers:
            assert numbers.attrs["caption"]
            quantities = [
                v for v in numbers.data_vars.values() if v.dtype.kind == "f" and "long_name" in v.attrs
            ]
            assert all("units" in v.attrs for v in quantities), path.name


def test_a_figure_is_drawn_again_from_its_file(album, tmp_path):
    for figure in figures_at_1000_pa():
        file = album / f"{figure.name}_1000Pa.nc"
        if file.exists():
            with xr.open_dataset(file, decode_times=False) as numbers:
                figure.draw(numbers.load()).savefig(tmp_path / "again.png")


@cache
def figures_at_1000_pa():
    return list(figures_of([RunDataset(small_runs()[1])]))


def numbers_of(name):
    return next(f.numbers for f in figures_at_1000_pa() if f.name.startswith(name))


def test_distributions_count_every_aggregate():
    run = RunDataset(small_runs()[1])
    total = run.population(-1).sizes["aggregate"]
    assert int(numbers_of("fig08a")["count"].sum()) == total
    assert int(numbers_of("fig08b")["count"].sum()) == total
    assert int(numbers_of("fig13")["count"].sum()) == total
    assert int(numbers_of("fig12a")["count"].sum()) == int((run.population(-1)["size"] > 2).sum())
    assert int(numbers_of("outcome_offset")["count"].sum()) == run.events.sizes["event"]
    late = (run.breakups["time"] >= run.steady.start).values
    for convention in CONVENTIONS:
        counted = int(numbers_of("fig16")["count"].sel(convention=convention).sum())
        assert counted == (late & in_convention(run.breakups, convention)).sum() > 0


def test_a_thinned_series_keeps_its_ends_and_extremes():
    time = np.arange(100_000.0)
    values = np.sin(time / 5000.0)
    values[[31_415, 92_653]] = 7.0, -7.0
    t, v = growth.thin(time, values)
    assert len(t) <= growth.MOST_POINTS + 2 and (np.diff(t) > 0).all()
    assert (t[0], t[-1], v.min(), v.max()) == (time[0], time[-1], -7.0, 7.0)
    np.testing.assert_array_equal(v, values[t.astype(int)])


@pytest.mark.parametrize("name", ["fig08a", "fig08b", "fig12a"])
def test_the_mean_of_the_stretch_lies_on_the_bins_of_the_histogram(name):
    figure = next(f for f in figures_at_1000_pa() if f.name.startswith(name))
    with look():
        steps = [
            patch for patch in figure.draw(figure.numbers).axes[0].patches if isinstance(patch, StepPatch)
        ]
    assert len(steps) == 3  # last snapshot, mean of the stretch, its scatter
    for one in steps:
        np.testing.assert_array_equal(one.get_data().edges, figure.numbers["edge"])


def test_one_aggregate_far_from_isostatic_does_not_squeeze_the_others():
    numbers = numbers_of("isostaticity").isel(aggregate=np.zeros(200, dtype=int)).copy(deep=True)
    numbers["bond_count"][:] = numbers["isostatic_bond_count"]
    numbers["bond_count"][0] -= 40
    with look():
        axes = bonds.draw_isostaticity(numbers).axes[0]
    assert np.ptp(axes.get_ylim()) < 8
    assert any("beyond: 1, to -40" in text for text in axes.get_legend_handles_labels()[1])


def test_stresses_may_have_any_number_of_replicas():
    one, other = (RunDataset(path) for path in small_runs())
    numbers = breakup.critical_size([one, other, other]).numbers
    alone = breakup.critical_size([one, other]).numbers
    np.testing.assert_allclose(numbers["mean_size"], alone["mean_size"], rtol=1e-12)
    np.testing.assert_allclose(
        numbers["mean_size_error"], alone["mean_size_error"] / [1, np.sqrt(2)], rtol=1e-12
    )


def test_pair_force_has_the_papers_scales():
    """F_adh = 11.07 nN, h_eq = -0.317 nm, h_po = 0.126 nm follow from Table 1."""
    numbers = numbers_of("fig05")
    np.testing.assert_allclose(numbers["pull_off_force"], 1.107e-8, rtol=2e-3)
    np.testing.assert_allclose(numbers["equilibrium_gap"], -0.317e-9, rtol=5e-3)
    np.testing.assert_allclose(numbers["pull_off_gap"], 0.126e-9, rtol=5e-3)
    np.testing.assert_allclose(numbers["force_attached"].min(), -1.107e-8, rtol=2e-3)
    at_equilibrium = np.interp(numbers["equilibrium_gap"], numbers["gap_attached"], numbers["force_attached"])
    assert abs(at_equilibrium) < 1e-11
    assert (numbers.attrs["apart"], numbers.attrs["attached"]) == ("van der Waals", "JKR")


@pytest.mark.parametrize(
    "names", [("van_der_waals", "double_layer", "jkr"), ("van_der_waals", "steric"), ("steric",), ("jkr",)]
)
def test_pair_force_shows_every_force_of_the_scene_and_their_sum(names):
    whole = effects_family.scene(*names)
    figure = pair_force(whole)
    numbers, forces = figure.numbers, whole.kernels.pair_forces
    assert numbers.sizes["law"] == len(forces)
    for gap, force in (("gap_apart", "force_apart"), ("gap_far", "force_far")):
        every = slice(None, None, 40)
        gaps = numbers[gap].values[every] / whole.reduced.length
        summed = [non_contact_force(h, 1.0, forces)[0] * whole.reduced.force for h in gaps] if forces else 0.0
        np.testing.assert_allclose(numbers[force].values[every], summed, rtol=1e-12, atol=1e-30)
    assert ("force_attached" in numbers) == ("jkr" in names)
    with look():
        assert overlaps(figure.draw(numbers)) == []


def test_initial_slope_is_that_of_equation_22():
    """4/pi x 0.078 x 1e-4 x 1e4 1/s at 750 Pa."""
    numbers = next(
        f.numbers for f in figures_of([RunDataset(small_runs()[0])]) if f.name.startswith("fig06a_initial")
    )
    np.testing.assert_allclose(numbers["initial_slope"], 0.0993, rtol=1e-3)
    # Ours, by `mcdem efficiency`, is a few per cent from the law there.
    np.testing.assert_allclose(numbers["computed_slope"], numbers["initial_slope"], rtol=0.1)


def test_moments_of_an_encounter_are_in_order_and_named_by_what_is_seen():
    found = moments(turning_trimer())
    assert list(found) == ["approach", "nearing", "contact", "parting", "drifting"]
    assert found["contact"] == 4  # the frame with a bond between i and j
    assert list(found.values()) == sorted(found.values())
    assert found["parting"] == 5


@pytest.mark.parametrize(
    ("bonded", "names"),
    [
        (slice(4, None), ["approach", "nearing", "contact", "together", "end"]),
        (slice(0, 0), ["approach", "nearing", "closest", "passing", "end"]),
    ],
)
def test_no_moment_is_called_parting_of_what_does_not_part(bonded, names):
    course = turning_trimer()
    tension = course.tension.copy()
    tension[:, 0, 2] = tension[:, 2, 0] = np.nan
    tension[bonded, 0, 2] = tension[bonded, 2, 0] = 5e-9
    found = moments(replace(course, tension=tension))
    assert list(found) == names
    assert list(found.values()) == sorted(found.values())


def test_plot_of_one_run(tmp_path):
    plot_run(small_runs()[1], tmp_path / "run.png")
    assert np.asarray(Image.open(tmp_path / "run.png").convert("L")).std() > 5


def test_command_draws_and_refuses(tmp_path):
    done = CliRunner().invoke(app, ["figures", str(small_runs()[1]), "-o", str(tmp_path / "figures")])
    assert done.exit_code == 0, done.output
    assert "fig16_largest_fragment.png" in done.output
    assert "left out: static_load: 0 of" in done.output  # its made-up aggregates are all floppy
    refused = CliRunner().invoke(app, ["figures", str(tmp_path / "no.nc")])
    assert refused.exit_code == 2 and "no such file" in refused.output
