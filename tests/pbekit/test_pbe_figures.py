"""Figures of balances: no text over another, none over data, and none that is empty."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from overlaps import overlaps
from pbe_synthetic import RADIUS, SHEAR_RATE, design

from pbekit import figures
from pbekit.figures import comparison as comparisons
from pbekit.figures import stresses
from pbekit.figures import table as tables
from pbekit.study.compare import Comparison
from pbekit.tables.kernel_table import KernelTable

SIZES = np.arange(1.0, 41.0)
ASSUMPTIONS = ["as tabulated", "products forget the parents' shape", "outcomes by the fitted law alone"]
LEGS = ["small", "large", "without a steady state"]


def banded(name, dims, value, width):
    return {
        name: (dims, value),
        f"{name}_low": (dims, value * (1 - width)),
        f"{name}_high": (dims, value * (1 + width)),
    }


def comparison(leg):
    """A comparison of made-up numbers: small ones, large ones, and one that bears no steady state."""
    scale = {"small": 1.0, "large": 300.0, "without a steady state": 1.0}[leg]
    time = np.linspace(0, 10 * scale, 41)
    growth = 1 + scale * (1 - np.exp(-time / time[-1] * 4))
    course = xr.Dataset(coords={"time": time})
    for key, unit in (("mean_size", 1.0), ("size_deviation", 0.6), ("sauter_diameter", 1e-6)):
        course = course.assign(banded(key, "time", unit * growth, 0.05))
        course[f"{key}_monte_carlo"] = ("time", unit * growth * 1.03)
        course[f"{key}_run_low"], course[f"{key}_run_high"] = (
            ("time", unit * growth * 0.8),
            ("time", unit * growth * 1.2),
        )
        course[f"{key}_analytical"] = ("time", unit * growth**1.1)
    density = np.exp(-SIZES / 6) / 6
    sizes = xr.Dataset(coords={"size": SIZES}, attrs={"steady_run": 1})
    keys = ["late_density"] if leg == "without a steady state" else ["late_density", "density"]
    for key in keys:
        sizes = sizes.assign(banded(key, "size", density, 0.1))
        sizes[f"{key}_analytical"] = ("size", np.exp(-SIZES / 5) / 5)
    sizes["late_density_run_low"], sizes["late_density_run_high"] = (
        ("size", 0 * density),
        ("size", 2 * density),
    )
    sizes["density_monte_carlo"] = ("size", np.where(SIZES % 7 == 0, 0.0, density))
    sizes["density_monte_carlo_error"] = ("size", density)
    numbers = {
        "end": time[-1],
        "late_from": 0.6 * time[-1],
        "late_distance": 0.1,
        "late_distance_run_high": 0.2,
    }
    for key in ("end_mean_size", "mean_size"):
        if key == "end_mean_size" or leg != "without a steady state":
            numbers |= {key: scale, f"{key}_low": 0.9 * scale, f"{key}_high": 1.1 * scale}
    numbers |= {"end_mean_size_run_low": 0.7 * scale, "end_mean_size_run_high": 1.4 * scale}
    steady = np.nan if leg == "without a steady state" else scale
    changed = xr.Dataset(
        {
            "mean_size": ("assumption", steady * np.array([1, 1.2, 0.9])),
            "end_mean_size": ("assumption", scale * np.array([1, 1.1, 0.95])),
            "late_distance": ("assumption", [0.1, 0.15, 0.12]),
        },
        {"assumption": ASSUMPTIONS},
    )
    return Comparison(course, sizes, numbers, changed, None, None, None)


def over_stresses(leg):
    stress = {"small": [1.0, 2.0], "large": [750.0, 875.0, 1000.0, 1250.0, 1500.0]}.get(
        leg, [10.0, 100.0, 1000.0]
    )
    stress = np.array(stress)
    scale = {"large": 1e4}.get(leg, 10.0)
    value = scale * (stress / stress[0]) ** -0.8
    if leg == "without a steady state":
        value[-1] = np.nan
    data = xr.Dataset(coords={"stress": stress})
    attrs = {}
    for key, unit in (("mean_size", 1.0), ("breakup_size", 3.0), ("sauter_diameter", 1e-7)):
        data = data.assign(banded(key, "stress", unit * value, 0.05))
        attrs |= {f"q_{key}{end}": 0.8 for end in ("", "_low", "_high")}
        if key != "breakup_size":
            data = data.assign(banded(f"{key}_interpolated", "stress", 1.02 * unit * value, 0.1))
            data[f"{key}_analytical"] = ("stress", 1.3 * unit * value)
            attrs[f"q_{key}_analytical"] = 2.3
    data["extrapolated"] = ("stress", np.linspace(0, 0.1, stress.size))
    data.attrs = attrs
    runs = {stress[0]: (value[0], 0.03 * value[0])}
    etas = xr.Dataset(coords={"stress": stress}).assign(banded("eta_11", "stress", 0.05 + 0 * stress, 0.2))
    etas["equation_23"] = ("stress", 0.06 + np.nan * stress if leg == "small" else 0.06 + 0 * stress)
    return data, runs, etas


def table(leg):
    """Three encounters, very many, and many of primaries alone."""
    count, largest = {"small": (3, 3), "large": (4000, 60)}.get(leg, (300, 1))
    records = design(np.random.default_rng(1), count, largest)
    return KernelTable.of(records, RADIUS, SHEAR_RATE, shape_edges=None)


DRAWN = {
    "table": lambda leg, path: figures.draw_table(table(leg), path),
    "course": lambda leg, path: figures.draw_course(comparison(leg), path),
    "distribution": lambda leg, path: figures.draw_distribution(comparison(leg), path),
    "ablation": lambda leg, path: figures.draw_ablation(comparison(leg), path),
    "volume fractions": lambda leg, path: figures.draw_volume_fractions(fractions(leg), path),
    "stresses": lambda leg, path: figures.draw_stress_law(*over_stresses(leg)[:2], path),
    "efficiencies": lambda leg, path: figures.draw_efficiencies(over_stresses(leg)[2], path),
}


def fractions(leg):
    phi = np.array([0.25, 0.5, 1, 2, 4]) * {"small": 1e-6, "large": 0.05}.get(leg, 2e-3)
    data = xr.Dataset({"tabulated": ("volume_fraction", 10 + 0 * phi)}, {"volume_fraction": phi})
    if leg != "small":
        data["analytical"] = ("volume_fraction", 10 + 30 * phi)
    return data


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("name", DRAWN)
def test_no_text_lies_over_another_or_over_data(name, leg, tmp_path, monkeypatch):
    kept = []
    for module in (comparisons, stresses, tables):
        monkeypatch.setattr(module, "save", lambda figure, data, path: kept.append(figure))
    DRAWN[name](leg, tmp_path / "figure")
    figure = kept[0]
    assert all(ax.has_data() for ax in figure.axes)
    assert overlaps(figure) == []


def test_a_figure_with_nothing_to_show_is_left_out_with_a_line(tmp_path, monkeypatch):
    found = comparison("without a steady state")
    for key in ("end", "late_from", "late_distance"):
        found.numbers.pop(key)
    drawn = []
    for name in ("draw_table", "draw_course", "draw_distribution", "draw_ablation", "draw_volume_fractions"):
        monkeypatch.setattr(comparisons, name, lambda *_, name=name: drawn.append(name))
    lines = figures.draw_comparison(found, tmp_path / "k")
    assert drawn == ["draw_table", "draw_course", "draw_distribution"]
    assert len(lines) == 2 and all("left out" in line for line in lines)
