"""How an encounter ends, by both sizes, shapes and the cohesion number: a logistic regression over all encounters.

efficiency    ln(eta/(1 - eta)) = sum of c_m x_m(P_i, P_j; N)
breakup       ln(p/(1 - p)) = sum of c_m x_m(P_i, P_j, shapes; N)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from pbekit.errors import PBEError
from pbekit.study.fitted_form import FEWEST_BROKEN, FittedLaw
from pbekit.tables.kernel_table import UNRESOLVED, KernelTable

LEAST = 20
"""Encounters of the outcome in a pair of classes whose residual is judged: their own scatter is below a quarter."""


@dataclass(frozen=True)
class OutcomeLaw(FittedLaw):
    """A probability of an encounter's end, by both sizes (and shapes, and the cohesion number)."""

    def __call__(
        self,
        size_i: ArrayLike,
        size_j: ArrayLike,
        *,
        shape: ArrayLike | None = None,
        cohesion: ArrayLike | None = None,
    ) -> np.ndarray:
        """The probability.

        Parameters
        ----------
        size_i, size_j : primaries of both
        shape : geometric mean of both shape coordinates; that of the table by default
        cohesion : number N; that of the table by default, where the law was fitted to one
        """
        size_i, size_j = np.broadcast_arrays(np.asarray(size_i, float), np.asarray(size_j, float))
        large, small = np.maximum(size_i, size_j), np.minimum(size_i, size_j)
        self.within(P=large, ratio=small / large)
        self.within(P=small)
        if cohesion is not None:
            if "N" not in self.validity:
                raise PBEError(
                    f"{self.name}: cohesion = {cohesion}: the tables do not say theirs, expected none"
                )
            self.within(N=cohesion)
        x = _outcome_features(size_i, size_j, names=self.names)
        if "shape" in self.names:
            middle = self.constants["shape_0"]
            shape = middle if shape is None else np.asarray(shape, float)
            self.within(shape=shape)
            x["shape"] = np.broadcast_to(np.log(shape / middle), size_i.shape)
        if "N" in self.names:
            cohesion = self.constants["N_0"] if cohesion is None else cohesion
            x["N"] = np.broadcast_to(np.log(np.asarray(cohesion) / self.constants["N_0"]), size_i.shape)
        total = np.sum([c * x[name] for c, name in zip(self.coefficients, self.names, strict=True)], axis=0)
        return special.expit(total)


OUTCOME_TERMS = {
    "c0": "1",
    "sum": "ln((P_i + P_j)/2)",
    "sum2": "ln((P_i + P_j)/2)^2",
    "ratio": "|ln(P_i/P_j)|",
    "ratio2": "ln(P_i/P_j)^2",
    "shape": "ln(shape/shape_0)",
    "N": "ln(N/N_0)",
}
"""Terms of the logit of an outcome."""


def _outcome_features(
    size_i: np.ndarray, size_j: np.ndarray, names: Sequence[str] | None = None
) -> dict[str, np.ndarray]:
    total, unlike = np.log(0.5 * (size_i + size_j)), np.abs(np.log(size_i / size_j))
    found = {
        "c0": np.ones_like(total),
        "sum": total,
        "sum2": total**2,
        "ratio": unlike,
        "ratio2": unlike**2,
    }
    return found if names is None else {name: value for name, value in found.items() if name in names}


def outcome_law(
    name: str, tables: Sequence[KernelTable], cohesion: np.ndarray, kinds: tuple[int, ...]
) -> OutcomeLaw | None:
    """By maximum likelihood over all encounters, with a ridge that lets no coefficient run off."""
    columns: list[dict[str, np.ndarray]] = []
    outcome, small, large, shapes, cell = [], [], [], [], []
    pairs = 0
    for table, n in zip(tables, cohesion, strict=True):
        if table.records.weighted:
            raise PBEError(
                "the table has encounters with weights (mcdem kernels --until-error), and the short forms of an export are "
                "fitted to counts: use its rates (pbekit solve), or export a table made without --until-error"
            )
        resolved = table.records.outcome != UNRESOLVED
        size = table.records.size[resolved].astype(float)
        x = _outcome_features(size[:, 0], size[:, 1])
        shape = table.records.shape(table.shape_name, table.radius)[resolved]
        shape = np.where((size > 2) & np.isfinite(shape), np.maximum(shape, 1e-12), np.nan)
        shapes.append(shape)
        x["N"] = np.full(len(size), np.log(n) if np.isfinite(n) else 0.0)
        columns.append(x)
        outcome.append(np.isin(table.records.outcome[resolved], kinds))
        small.append(size.min(axis=1))
        large.append(size.max(axis=1))
        flat = KernelTable(table.records, table.size_edges, None, table.radius, table.shear_rate).pair
        cell.append(flat[resolved] + pairs)
        pairs += int(flat.max(initial=-1)) + 1
    y = np.concatenate(outcome).astype(float)
    if y.sum() < FEWEST_BROKEN:
        return None
    x = {key: np.concatenate([column[key] for column in columns]) for key in columns[0]}
    mean_shape = np.concatenate(shapes)
    known = np.isfinite(mean_shape)
    middle = float(np.exp(np.log(mean_shape[known]).mean())) if known.any() else 1.0
    # Primaries and doublets have one shape: they are given the typical one, their own being in the size.
    logs = np.where(known, np.log(np.where(known, mean_shape, 1.0) / middle), 0.0).mean(axis=1)
    constants = {"shape_0": middle}
    terms = ["c0", "sum", "sum2", "ratio", "ratio2"]
    validity: dict[str, tuple[float, float]] = {
        "P": (float(np.concatenate(small).min()), float(np.concatenate(large).max())),
        "ratio": (float((np.concatenate(small) / np.concatenate(large)).min()), 1.0),
    }
    if known.any() and np.ptp(logs) > 0:
        terms.append("shape")
        x["shape"] = logs
        validity["shape"] = (float(middle * np.exp(logs.min())), float(middle * np.exp(logs.max())))
    if np.isfinite(cohesion).all():
        constants["N_0"] = float(np.exp(np.log(cohesion).mean()))
        validity["N"] = (float(cohesion.min()), float(cohesion.max()))
        x["N"] = x["N"] - np.log(constants["N_0"])
        if np.unique(cohesion).size > 1:
            terms.append("N")
    else:
        constants["N_0"] = np.nan
    features = np.stack([x[key] for key in terms], axis=1)
    c, covariance = _logistic(features, y)
    of_cell = np.concatenate(cell)
    p = special.expit(features @ c)
    trials, seen, expected = (np.bincount(of_cell, w, pairs) for w in (np.ones_like(y), y, p))
    spread = np.bincount(of_cell, p * (1 - p), pairs)
    usable = (expected >= 5) & (trials - expected >= 5)
    widened = 1.0
    if usable.sum() > len(c):
        chi2 = ((seen - expected)[usable] ** 2 / spread[usable]).sum()
        widened = max(1.0, chi2 / (usable.sum() - len(c)))
    judged = seen >= LEAST
    residual = float(np.abs(expected[judged] / seen[judged] - 1).max()) if judged.any() else np.nan
    symbol = "eta" if name == "efficiency" else "p"
    return OutcomeLaw(
        name,
        f"ln({symbol}/(1 - {symbol})) = " + " + ".join(f"{t} * {OUTCOME_TERMS[t]}" for t in terms),
        tuple(terms),
        c,
        covariance * widened,
        validity,
        residual,
        f"{symbol} of a pair of size classes with {LEAST} such encounters or more, relative",
        {key: value for key, value in constants.items() if np.isfinite(value)},
    )


def _logistic(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and their covariance by Newton's method; a weak ridge on standardised features."""
    centre, scale = x.mean(axis=0), x.std(axis=0)
    scale = np.where(scale > 1e-12, scale, 1.0)
    centre = np.where(np.arange(x.shape[1]) == 0, 0.0, centre)
    z = (x - centre) / scale
    ridge = np.r_[1e-6, np.full(x.shape[1] - 1, 1e-2)]
    c = np.r_[special.logit(np.clip(y.mean(), 1e-9, 1 - 1e-9)), np.zeros(x.shape[1] - 1)]

    def objective(c: np.ndarray) -> tuple[float, np.ndarray]:
        line = z @ c
        value = np.logaddexp(0.0, line).sum() - y @ line + 0.5 * (ridge * c**2).sum()
        return float(value), z.T @ (special.expit(line) - y) + ridge * c

    def hessian(c: np.ndarray) -> np.ndarray:
        p = special.expit(z @ c)
        return (z * (p * (1 - p))[:, None]).T @ z + np.diag(ridge)

    found = optimize.minimize(objective, c, jac=True, hess=hessian, method="trust-exact", tol=1e-9)
    back = np.diag(1 / scale)
    back[0] -= centre / scale
    back[0, 0] = 1.0
    return back @ found.x, back @ np.linalg.inv(hessian(found.x)) @ back.T
