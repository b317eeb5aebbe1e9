"""The files that serve everyone: classes, pairs, first-order rates, daughters and their moments, fits, what to come to."""

from __future__ import annotations

import json

import numpy as np

from pbekit.errors import PBEError
from pbekit.export.target import MARK, HandOver, columns
from pbekit.study.shape_relaxation import shape_relaxation
from pbekit.study.size_rates import MOMENTS

NOTES = {
    "classes.csv": "classes of size: primaries P, outer radius R, radius of gyration R_g, collision diameter 2 R",
    "pairs.csv": "for each pair of classes i <= j: encounters counted, efficiency eta, breakup probability p, and the rates "
    "f = (4/3) g <(R_i + R_j)^3>, K = f eta, B = f p, with 90 % limits; trials are those of the pair of tabulated classes that "
    "holds i and j; extrapolated = 1 where none was made there",
    "daughters.csv": "for each pair: expected number of products in class k of an encounter after which other aggregates are "
    "left, with its standard error, and the share of the mass they hold",
    "daughter_moments.csv": "moments 0 to 5 of the daughters over x = P_k/(P_i + P_j): order 0 is their number, order 1 is one",
    "first_order.csv": "what breakup by encounters amounts to as breakup of first order in one population n: M, the rate of "
    "encounters that break, and S, the rate of breakages in two that makes as many new aggregates",
    "shapes.csv": "restructuring as relaxation of shape, by class of size of the table: survivors counted, the share kappa of "
    "the way to the resting shape that an encounter takes, that shape, encounters survived per unit time in the population of "
    "first_order.csv, and the rate of relaxation, with 90 % limits; nan where too few were seen or shapes do not relax",
    "course.csv": "mean size over time from free primaries, with its 90 % band",
    "steady.csv": "share in number of each size at steady state, with its 90 % band",
    "fit.json": "short forms with coefficients, covariance, range of validity and largest residual",
}


def plain_files(given: HandOver) -> dict[str, str]:
    """All of them, by name; those that nothing bears are left out."""
    rates, grid = given.rates, given.rates.grid
    index = np.arange(1, grid.sizes + 1)
    inner = np.ceil(grid.edges).astype(int)
    population = {}
    if rates.first_order is not None:
        population = {"n [1/m^3]": rates.first_order.population}
    found = {
        "classes.csv": columns(
            {
                "class": index,
                "P_low [1]": inner[:-1],
                "P_high [1]": np.maximum(inner[1:] - 1, inner[:-1]),
                "P [1]": grid.pivots.astype(int),
                "R [m]": rates.outer_radius,
                "R_g [m]": rates.radius_of_gyration,
                "collision_diameter [m]": 2 * rates.outer_radius,
            }
        ),
        "pairs.csv": _pairs(given),
    }
    if rates.breaks:
        found |= {"daughters.csv": _daughters(given), "daughter_moments.csv": _moments(given)}
    if rates.first_order is not None and rates.breaks:
        first = rates.first_order
        table = {"class": index, "P [1]": grid.pivots.astype(int), **population}
        for name, limits in (("M", first.meeting), ("S", first.breakage)):
            table |= {
                f"{name} [1/s]": limits.value,
                f"{name}_low [1/s]": limits.low,
                f"{name}_high [1/s]": limits.high,
            }
        found["first_order.csv"] = columns(table)
    if shapes := _shapes(given):
        found["shapes.csv"] = shapes
    data = given.solution
    course = {"time [s]": data.time.values, "mean_size [1]": data.mean_size.values}
    for end in ("low", "high"):
        if f"mean_size_{end}" in data:
            course[f"mean_size_{end} [1]"] = data[f"mean_size_{end}"].values
    found["course.csv"] = columns(course)
    if "steady_share" in data:
        steady = {"class": index, "P [1]": grid.pivots.astype(int), "share [1]": data.steady_share.values}
        for end in ("low", "high"):
            if f"steady_share_{end}" in data:
                steady[f"share_{end} [1]"] = data[f"steady_share_{end}"].values
        found["steady.csv"] = columns(steady)
    found["fit.json"] = json.dumps(_fit(given), indent=1) + "\n"
    return found


def _upper(sizes: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(sizes)


def _pairs(given: HandOver) -> str:
    rates = given.rates
    i, j = _upper(rates.grid.sizes)
    whole = rates.pivots.astype(int)
    table = {
        "class_i": i + 1,
        "class_j": j + 1,
        "P_i [1]": whole[i],
        "P_j [1]": whole[j],
        "trials [1]": rates.trials[i, j],
        "aggregated [1]": rates.aggregated[i, j],
        "broke [1]": rates.broken[i, j],
    }
    for name, unit, of in (
        ("eta", "1", rates.efficiency),
        ("p", "1", rates.breakup),
        ("f", "m^3/s", rates.encounter_rate),
        ("K", "m^3/s", rates.aggregation_rate),
        ("B", "m^3/s", rates.breakup_rate),
    ):
        table |= {
            f"{name} [{unit}]": of.value[i, j],
            f"{name}_low [{unit}]": of.low[i, j],
            f"{name}_high [{unit}]": of.high[i, j],
        }
    return columns({**table, "extrapolated [1]": rates.extrapolated[i, j]})


def _shapes(given: HandOver) -> str | None:
    """Relaxation of shape, or None where nothing was seen of it."""
    try:
        found = shape_relaxation(given.rates)
    except PBEError:
        return None
    table = {"P_low [1]": found.low, "P_high [1]": found.high, "survivors [1]": found.survivors}
    for name, limits in (
        ("kappa [1]", found.kappa),
        ("resting_shape [1]", found.resting_shape),
        ("rate [1/s]", found.rate),
    ):
        of, unit = name.split()
        table |= {name: limits.value, f"{of}_low {unit}": limits.low, f"{of}_high {unit}": limits.high}
    return columns({**table, "spread [1]": found.spread, "survived [1/s]": found.surviving})


def _daughters(given: HandOver) -> str:
    rates, whole = given.rates, given.rates.pivots.astype(int)
    i, j = _upper(rates.grid.sizes)
    pair, k = np.nonzero(rates.daughters[i, j])
    i, j = i[pair], j[pair]
    number, total = rates.daughters[i, j, k], whole[i] + whole[j]
    return columns(
        {
            "class_i": i + 1,
            "class_j": j + 1,
            "class_k": k + 1,
            "P_i [1]": whole[i],
            "P_j [1]": whole[j],
            "P_k [1]": whole[k],
            "x [1]": whole[k] / total,
            "number [1]": number,
            "number_error [1]": rates.daughters_error[i, j, k],
            "mass_fraction [1]": number * whole[k] / total,
        }
    )


def _moments(given: HandOver) -> str:
    i, j = _upper(given.rates.grid.sizes)
    moments = given.rates.moments()[i, j]
    whole = given.rates.pivots.astype(int)
    return columns(
        {
            "class_i": i + 1,
            "class_j": j + 1,
            "P_i [1]": whole[i],
            "P_j [1]": whole[j],
            **{f"moment_{m} [1]": moments[:, m] for m in range(MOMENTS)},
        }
    )


def _fit(given: HandOver) -> dict[str, object]:
    about, first = given.rates.table.about, given.rates.first_order
    conditions: dict[str, object] = {
        "primary_radius_m": given.radius,
        "shear_rate_per_s": given.shear_rate,
        "volume_fraction": None if np.isnan(given.volume_fraction) else given.volume_fraction,
    }
    for key, name in (
        ("viscosity", "viscosity_Pa_s"),
        ("cohesion_number", "cohesion_number"),
        ("scene_name", "scene"),
    ):
        if key in about:
            value = about[key]
            conditions[name] = value if isinstance(value, str) else float(value)
    if first is not None:
        conditions["population_of_first_order_rates"] = first.words
    steady = given.steady_mean_size
    return {
        "written_by": MARK,
        "table": given.source,
        "conditions": conditions,
        "steady_mean_size": None
        if steady is None
        else dict(zip(("value", "low", "high"), (None if np.isnan(v) else v for v in steady), strict=True)),
        "laws": given.laws.record(),
    }
