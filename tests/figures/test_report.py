"""The report shows the run, its warnings and the comparison, in one file."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from small_runs import small_runs
from typer.testing import CliRunner

import mcdem
from mcdem.analysis.dataset import RunDataset, by_stress
from mcdem.analysis.paper_comparison import Row, breakup_exponents, compare
from mcdem.analysis.statistics import count_limits
from mcdem.commands.main import app
from mcdem.figures.report import _too_long, dimensionless_groups, parameters, report, warnings
from mcdem.quantities.linear_flows import draw_offset


@pytest.fixture(scope="module")
def run():
    return RunDataset(small_runs()[1])


def test_page_holds_everything_and_fetches_nothing():
    page = report(small_runs()[1])
    assert not re.search(r'(src|href)="(?!data:)', page)
    for words in (
        "Beside the paper",
        "Warnings",
        "shear_rate",
        "fragmentation",
        "fig16_largest_fragment",
        "η₁₁",
    ):
        assert words in page
    assert page.count("data:image/png;base64,") >= 15


def test_groups_are_those_of_table_1(run):
    """0.426, 5.7e5 and 6.9e-7 at 1000 Pa follow from Table 1."""
    groups = {symbol: value for symbol, _, value in dimensionless_groups(run)}
    np.testing.assert_allclose(groups["6πμγ̇a²/F_adh"], 0.426, rtol=2e-3)
    np.testing.assert_allclose(groups["Pe"], 5.7e5, rtol=1e-2)
    np.testing.assert_allclose(groups["C_A = A_H/36πμγ̇a³"], 6.9e-7, rtol=1e-2)
    np.testing.assert_allclose(groups["η₁₁"], 0.074, rtol=5e-3)


def test_every_parameter_of_the_scene_is_said(run):
    said = {(table, key): value for table, key, value, _ in parameters(run)}
    assert said["suspension", "radius"] == "5e-07"
    assert said["effects.jkr", "surface_energy"] == "0.0047"
    assert said["population", "initial"] == "50"


def test_warnings_of_a_short_run(run):
    text = " ".join(warnings(run))
    assert "No steady state" in text
    assert "Few breakups" in text
    assert "doubled" in text


def test_comparison_waits_for_the_steady_state(run):
    rows = {row.quantity: row for row in compare([run])}
    early = ("η₁₁", "at the start", "growth from", "first clusters")
    late = [row for name, row in rows.items() if not any(words in name for words in early)]
    assert len(late) > 20
    assert all(row.unsettled and row.agrees is None for row in late)
    efficiency = rows["collision efficiency η₁₁ (Eq. 23)"]
    assert not efficiency.unsettled
    monomers = (run.events["parent_size"].values == 1).all(axis=1)
    assert efficiency.count == monomers.sum()
    assert efficiency.measured == (run.outcome[monomers] == "aggregation").mean()
    assert efficiency.agrees is False  # toy encounters stick far more often


def test_growth_is_that_of_the_series(run):
    """Slope over a stretch: rise over time between two levels, known to the Poisson scatter of its aggregations."""
    size, time = run.series["mean_size"].values, run.time
    begun, ended = (int(np.flatnonzero(size >= level)[0]) for level in (1.0, 1.25))
    row = next(row for row in compare([run]) if "at the start" in row.quantity)
    events = int((run.outcome[begun:ended] == "aggregation").sum())
    slope = (size[ended] - size[begun]) / (time[ended] - time[begun])
    assert (row.measured, row.count) == (pytest.approx(slope), events)
    low, high = count_limits(events)
    assert row.measured_low == pytest.approx(slope * low / events)
    assert row.measured_high == pytest.approx(slope * high / events)
    np.testing.assert_allclose(float(row.printed), 4 / np.pi * 0.07384 * 1e-4 * 1e4, rtol=1e-3)


def test_verdict_is_about_limits():
    assert Row("x", "1.68", 1.675, 1.685, 1.6, 1.5, 1.7, 50).agrees is True
    assert Row("x", "1.68", 1.675, 1.685, 1.5, 1.4, 1.6, 50).agrees is False
    assert Row("x", "1.68", 1.675, 1.685, 1.6, 0.0, 9.0, 50).agrees is None
    assert Row("x", "1.68", 1.675, 1.685, np.nan, np.nan, np.nan, 0).agrees is None
    assert Row("x", "0.10", 0.05, 0.15, 0.0, 0.0, 4e-4, 10_000).agrees is False
    assert Row("x", "0.10", 0.05, 0.15, 0.0, 0.0, 0.3, 10).agrees is None


def test_one_convention_is_judged_and_the_others_are_sensitivity():
    other = Row("x", "1.68", 1.675, 1.685, 1.5, 1.4, 1.6, 50, sensitivity=True)
    assert other.agrees is None


def test_each_printed_number_has_one_verdict(run):
    rows = compare([run])
    judged = {row.quantity for row in rows if not row.sensitivity}
    for printed, conventions in (
        ("d_g, P > 3", 2),
        ("k_g, P > 3", 2),
        ("d_o, P > 3", 2),
        ("largest fragment 0.45", 3),
        ("erosion's share", 3),
        ("exponent of the solid fraction in the ellipsoid", 2),
    ):
        names = [row.quantity for row in rows if row.quantity.startswith(printed)]
        assert (len(names), len(judged.intersection(names))) == (conventions, 1)


def test_no_exponent_from_two_stresses():
    assert breakup_exponents(by_stress([RunDataset(path) for path in small_runs()])) == []


def test_command_refuses_to_overwrite(tmp_path):
    page = tmp_path / "report.html"
    page.write_text("mine")
    refused = CliRunner().invoke(app, ["report", str(small_runs()[1]), "-o", str(page)])
    assert refused.exit_code == 2 and "--overwrite" in refused.output
    assert page.read_text() == "mine"


def test_unresolved_approaches_are_reported_with_their_share_of_the_flux():
    """1.5 (z0/longest_approach)^2 by the integral of y over the strip; drawn offsets agree."""
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes({"numerics.longest_approach": 50.0})
    assert "carry 0.015 of the flux" in _too_long(SimpleNamespace(scene=scene))
    rng = np.random.default_rng(1)
    near = [draw_offset(scene.flow, 1.0, rng)[1] < 0.1 for _ in range(20_000)]
    assert np.mean(near) == pytest.approx(0.015, abs=0.004)
    assert _too_long(SimpleNamespace(scene=mcdem.load_scene("scenes/uniaxial-extension.toml"))) == ""
