"""No text lies over another, over data or out of its figure: every figure, on few data, on many and on many stresses."""

from __future__ import annotations

import numpy as np
import pytest
import toy_encounters
from overlaps import overlaps
from small_runs import SCENES
from trimer import turning_trimer

from mcdem.analysis.accuracy_cost import Price, Setting, settings_of
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.sensitivity import ETA, STRICT, Difference
from mcdem.figures import album, cost, early_growth, figures_of, sensitivity
from mcdem.figures.style import look
from mcdem.monte_carlo.run_control import run
from mcdem.scene import load_scene


def toy_run(folder, stress, events):
    """A run of made-up encounters of the paper's suspension."""
    scene = load_scene(SCENES / "paper-1000Pa.toml").with_changes(
        {"flow.shear_stress": f"{stress} Pa", "population.initial": 30, "run.until": None}
    )
    path = folder / f"run-{stress}Pa.nc"
    run(scene, path, events=events, encounter=toy_encounters.toy_encounter)
    return RunDataset(path)


LEGS = {
    "few": lambda folder: [toy_run(folder, 1000, 70)],
    "many": lambda folder: [RunDataset("notebooks/data/run-750Pa-of-100.nc")],
    "stresses": lambda folder: [toy_run(folder, stress, 40) for stress in (90, 750, 875, 1000, 1500)],
}


@pytest.mark.parametrize("leg", LEGS)
def test_no_text_lies_over_another_or_over_data(leg, tmp_path, monkeypatch):
    monkeypatch.setattr(early_growth, "computed_efficiency", lambda scene: 0.075)
    if leg == "stresses":
        monkeypatch.setattr(toy_encounters, "CRITICAL", 4)
        # Those of one stress are drawn by the other two.
        monkeypatch.setattr(album, "OF_ONE_STRESS", ())
    runs, left_out, amiss, names = LEGS[leg](tmp_path), [], {}, []
    for figure in figures_of(runs, [turning_trimer()] if leg == "few" else [], left_out.append):
        with look():
            drawn = figure.draw(figure.numbers)
            assert any(ax.has_data() for ax in drawn.axes), figure.name
            if found := overlaps(drawn):
                amiss[figure.name] = found
        names.append(figure.name)
    assert amiss == {}
    assert len(names) + len(left_out) == len(album.OF_ALL_RUNS) + len(album.OF_ONE_STRESS) + (leg == "few")
    assert len(left_out) <= {"few": 5, "many": 1, "stresses": 0}[leg]
    assert all(len(line) < 250 and ": " in line for line in left_out)


def prices(settings, seed):
    """Made-up prices: some without a difference, some without a limit."""
    rng = np.random.default_rng(seed)
    error = 10.0 ** rng.uniform(-5, -1, (len(settings), 4)) * rng.integers(0, 2, (len(settings), 4))
    limit = error + 10.0 ** rng.uniform(-3, -1, error.shape)
    limit[-1] = np.inf
    time = 10.0 ** rng.uniform(-3, 0, len(settings))
    return [
        Price(setting, error[k], 0.5 * error[k], time[k], 100.0, 0.1, limit[k], 0.1 * time[k])
        for k, setting in enumerate(settings)
    ]


def differences(settings, encounters):
    """Made-up differences, none of them seen where there are few encounters."""
    wide = 1.0 / np.sqrt(encounters)
    return [
        Difference(s, name, 0.1, 0.1 + 0.1 * wide, wide, encounters, 0.01, -wide, wide)
        for s in settings
        for name in (ETA, "aggregation", "parted", STRICT)
    ]


@pytest.mark.parametrize("count", [2, 3, None])
def test_rows_of_settings_keep_their_names_apart(count, tmp_path, monkeypatch):
    """Of the shortest table, and of all that `mcdem cost` tries."""
    kept = []
    for module in (cost, sensitivity):
        monkeypatch.setattr(module.FILES, "write_picture", lambda path, figure: kept.append(figure))
    settings = settings_of(load_scene(SCENES / "paper-1000Pa.toml"))[:count]
    cost.draw_front(prices(settings, 1), tmp_path / "cost.png", "paper-1000Pa", 100)
    keys = [Setting("as given", "as given"), *(Setting(f"{s.name} too", s.varied) for s in settings[1:])]
    sensitivity.draw_differences(differences(keys, 60), tmp_path / "sensitivity.png", "paper-1000Pa")
    with look():
        assert [overlaps(figure) for figure in kept] == [[], []]


def test_the_course_of_a_run_is_a_series_of_steps(tmp_path, monkeypatch):
    """A value holds until the next encounter: no line slopes from one to the next."""
    monkeypatch.setattr(early_growth, "computed_efficiency", lambda scene: 0.075)
    with look():
        drawn = early_growth.draw_course(early_growth.course(toy_run(tmp_path, 1000, 12)))
        assert overlaps(drawn) == []
    assert [ax.lines[0].get_drawstyle() for ax in drawn.axes] == ["steps-post", "steps-post"]
