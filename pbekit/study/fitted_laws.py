"""Short forms of what a table says, for solvers and scripts that take a formula: coefficients, covariance, range, residual.

    radius        R = a (P/k)^(1/d)
    efficiency    ln(eta/(1 - eta)) = sum of c_m x_m(P_i, P_j; N)
    breakup       ln(p/(1 - p)) = sum of c_m x_m(P_i, P_j, shapes; N)
    breakage      S = k phi g N^p P^q, the binary breakage of first order that encounters amount to (`size_rates`)
    daughters     mass-weighted density over x = P_f/(P_i + P_j): two beta peaks, of means m, concentrations c and shares w
    parts         of an aggregate that itself falls apart, over x = P_f/P_i: two, x and 1 - x, of density ~ (x (1 - x))^(c - 1)

A form is not the table: each says by how much it misses what it was fitted to, and refuses outside the range of that.
Where the scatter about a form is more than that of counting, the covariance is widened by as much (quasi-likelihood,
McCullagh & Nelder 1989).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special, stats

from pbekit.arguments import number
from pbekit.balance.breakage import BetaSplit, TwoBeta
from pbekit.errors import PBEError
from pbekit.study.size_rates import SizeRates
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED, UNRESOLVED, KernelTable

LEAST = 20
"""Encounters of the outcome in a pair of classes whose residual is judged: their own scatter is below a quarter."""
HELD = 0.98
"""Share of the broken mass in the sizes over which the breakage law is fitted and holds."""
FEWEST_BROKEN = 10
"""Encounters that broke something, below which no law of breakup is fitted."""


@dataclass(frozen=True)
class FittedLaw:
    """Coefficients of a form, and what is known of them.

    Parameters
    ----------
    name, formula : of the form, and its text
    names : of the m coefficients
    coefficients : (m,)
    covariance : (m, m)
    validity : lowest and highest value of each argument that the fit rests on
    residual : largest residual, in the sense that `residual_of` gives
    residual_of : what the residual is of
    """

    name: str
    formula: str
    names: tuple[str, ...]
    coefficients: np.ndarray
    covariance: np.ndarray
    validity: dict[str, tuple[float, float]]
    residual: float
    residual_of: str
    constants: dict[str, float] = field(default_factory=dict)

    def coefficient(self, name: str) -> float:
        """The coefficient of this name."""
        return float(self.coefficients[self.names.index(name)])

    def within(self, **given: ArrayLike) -> None:
        """Refuse arguments outside the range of the fit; raises `PBEError`."""
        for name, values in given.items():
            low, high = self.validity[name]
            values = np.asarray(values, float)
            bad = ~((values >= low * (1 - 1e-9)) & (values <= high * (1 + 1e-9)))
            if np.any(bad):
                raise PBEError(
                    f"{self.name}: {name} = {np.ravel(values[bad])[0]:g}: expected from {low:g} to {high:g}, the range "
                    "over which "
                    "the law was fitted; beyond it nothing is known"
                )

    def record(self) -> dict[str, Any]:
        """All of it in plain types, as it stands in fit.json."""
        return {
            "formula": self.formula,
            "coefficients": dict(zip(self.names, map(float, self.coefficients), strict=True)),
            "standard_errors": dict(
                zip(self.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True)
            ),
            "covariance": self.covariance.tolist(),
            "constants": self.constants,
            "valid": {name: list(ends) for name, ends in self.validity.items()},
            "largest_residual": self.residual,
            "largest_residual_of": self.residual_of,
        }


@dataclass(frozen=True)
class RadiusLaw(FittedLaw):
    """R = a (P/k)^(1/d)."""

    def __call__(self, size: ArrayLike) -> np.ndarray:
        """R [m] of aggregates of so many primaries."""
        p = np.asarray(size, float)
        self.within(P=p)
        return self.constants["a"] * (p / self.coefficient("k")) ** (1 / self.coefficient("d"))


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


@dataclass(frozen=True)
class BreakageLaw(FittedLaw):
    """S = k phi g N^p P^q."""

    def __call__(
        self, size: ArrayLike, volume_fraction: float, shear_rate: float, cohesion: float | None = None
    ) -> np.ndarray:
        """S [1/s] of parents of so many primaries."""
        p = np.asarray(size, float)
        self.within(P=p)
        number("volume fraction", volume_fraction, 0.0, 1.0)
        number("shear rate", shear_rate, 0.0, 1e12)
        found = self.coefficient("k") * volume_fraction * shear_rate * p ** self.coefficient("q")
        if "p" in self.names:
            cohesion = self.constants["N_0"] if cohesion is None else cohesion
            self.within(N=cohesion)
            found = found * (cohesion / self.constants["N_0"]) ** self.coefficient("p")
        return found


@dataclass(frozen=True)
class DaughtersLaw(FittedLaw):
    """Two beta peaks of the mass-weighted density over x = P_f/(P_i + P_j)."""

    @property
    def daughters(self) -> TwoBeta:
        """As the balance takes them."""
        return TwoBeta(*map(float, self.coefficients))

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """The mass-weighted density, of integral one."""
        self.within(x=x)
        return self.daughters.mass_density(np.asarray(x, float))


@dataclass(frozen=True)
class PartsLaw(FittedLaw):
    """Two parts of a parent, x and 1 - x."""

    @property
    def daughters(self) -> BetaSplit:
        """As the balance takes them."""
        return BetaSplit(self.coefficient("c"))

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """The mass-weighted density, of integral one."""
        self.within(x=x)
        x = np.asarray(x, float)
        return stats.beta.pdf(x, self.coefficient("c") + 1, self.coefficient("c"))


@dataclass(frozen=True)
class FittedLaws:
    """The laws of one table, or of several over the cohesion number; those that nothing bears are None."""

    radius: RadiusLaw
    efficiency: OutcomeLaw | None
    breakup: OutcomeLaw | None
    breakage: BreakageLaw | None
    daughters: DaughtersLaw | None
    parts: PartsLaw | None

    def record(self) -> dict[str, Any]:
        """As they stand in fit.json."""
        names = ("radius", "efficiency", "breakup", "breakage", "daughters", "parts")
        every = {name: getattr(self, name) for name in names}
        return {name: None if law is None else law.record() for name, law in every.items()}


def fitted_laws(rates: SizeRates | Sequence[SizeRates]) -> FittedLaws:
    """Fit all laws to the rates of a table, or of several at different cohesion numbers.

    Parameters
    ----------
    rates : SizeRates or sequence of SizeRates
        Of `size_rates`.

    Returns
    -------
    FittedLaws
        The short forms, each with its residuals.

    Raises
    ------
    PBEError
        Of several tables of other shapes or without their cohesion numbers.

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> laws = pbekit.fitted_laws(pbekit.size_rates(table, draws=20, largest=40))
    >>> [name for name in vars(laws)][:4]
    ['radius', 'efficiency', 'breakup', 'breakage']
    """
    every = [rates] if isinstance(rates, SizeRates) else list(rates)
    tables = [one.table for one in every]
    cohesion = [one.about.get("cohesion_number") for one in tables]
    if len(every) > 1:
        if any(n is None for n in cohesion):
            raise PBEError("tables: one does not say its cohesion number, and a law over several needs it")
        if len({one.shape_name for one in tables}) > 1:
            raise PBEError("tables: of different shape coordinates, so that one law cannot hold for all")
    numbers = np.array([np.nan if n is None else float(n) for n in cohesion])
    return FittedLaws(
        radius=_radius(every),
        efficiency=_outcome("efficiency", tables, numbers, (AGGREGATION,)),
        breakup=_outcome("breakup", tables, numbers, SCATTERED),
        breakage=_breakage(every, numbers),
        daughters=_daughters(tables),
        parts=_parts(tables),
    )


def _weighted(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and covariance of y = x c with weights; the scatter about it is that of the residuals."""
    root = np.sqrt(weight / weight.max())
    c, *_ = np.linalg.lstsq(x * root[:, None], y * root, rcond=None)
    left = (y - x @ c) * root
    inverse = np.linalg.inv((x * root[:, None]).T @ (x * root[:, None]))
    scores = (x * root[:, None]) * left[:, None]
    freedom = len(y) / max(len(y) - len(c), 1)
    return c, freedom * inverse @ (scores.T @ scores) @ inverse


def _radius(every: Sequence[SizeRates]) -> RadiusLaw:
    """Of the classes that were seen, from three primaries on; each counts alike."""
    size, radius = [], []
    for one in every:
        records = one.table.records
        seen = (one.pivots >= 3) & (one.pivots <= records.size.max(initial=1))
        size.append(one.pivots[seen])
        radius.append((one.outer_radius / one.table.radius)[seen])
    p, r = np.concatenate(size), np.concatenate(radius)
    a = every[0].table.radius
    if p.size < 3:
        # Primaries and doublets alone: R = a P.
        return RadiusLaw(
            "radius", "R = a (P/k)^(1/d)", ("k", "d"), np.ones(2), np.zeros((2, 2)), {"P": (1.0, 2.0)}, 0.0,
            "R, relative", {"a": a},
        )  # fmt: skip
    (c0, c1), covariance = _weighted(
        np.stack([np.ones(p.size), np.log(p)], axis=1), np.log(r), np.ones(p.size)
    )
    # ln R/a = (ln P - ln k)/d.
    d, k = 1 / c1, np.exp(-c0 / c1)
    jacobian = np.array([[-k / c1, k * c0 / c1**2], [0.0, -1 / c1**2]])
    fit = np.exp(c0 + c1 * np.log(p))
    return RadiusLaw(
        "radius",
        "R = a (P/k)^(1/d)",
        ("k", "d"),
        np.array([k, d]),
        jacobian @ covariance @ jacobian.T,
        {"P": (float(p.min()), float(p.max()))},
        float(np.abs(fit / r - 1).max()),
        "R, relative",
        {"a": a},
    )


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


def _outcome(
    name: str, tables: Sequence[KernelTable], cohesion: np.ndarray, kinds: tuple[int, ...]
) -> OutcomeLaw | None:
    """By maximum likelihood over all encounters, with a ridge that lets no coefficient run off."""
    columns: list[dict[str, np.ndarray]] = []
    outcome, small, large, shapes, cell = [], [], [], [], []
    pairs = 0
    for table, n in zip(tables, cohesion, strict=True):
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


def _breakage(every: Sequence[SizeRates], cohesion: np.ndarray) -> BreakageLaw | None:
    """ln S over ln P (and ln N), each size with the share of the broken mass that it makes."""
    p, y, weight, ln_n, used = [], [], [], [], []
    for one, n in zip(every, cohesion, strict=True):
        first = one.first_order
        if first is None or one.broken.sum() < FEWEST_BROKEN:
            continue
        s = first.breakage.value
        flux = s * first.population * one.pivots
        order = np.argsort(-flux)
        kept = order[: int(np.searchsorted(np.cumsum(flux[order]) / flux.sum(), HELD)) + 1]
        kept = np.sort(kept[one.pivots[kept] <= one.table.records.size.max()])
        p.append(one.pivots[kept])
        y.append(np.log(s[kept] / (first.volume_fraction * one.table.shear_rate)))
        weight.append(flux[kept] / flux[kept].sum())
        ln_n.append(np.full(kept.size, np.log(n)))
        used.append(n)
    if not p or sum(map(len, p)) < 3:
        return None
    sizes, value, w, n = (np.concatenate(part) for part in (p, y, weight, ln_n))
    columns, names = [np.ones(sizes.size), np.log(sizes)], ["k", "q"]
    constants, validity = {}, {"P": (float(sizes.min()), float(sizes.max()))}
    if np.unique(used).size > 1:
        constants["N_0"] = float(np.exp(np.log(used).mean()))
        columns.append(n - np.log(constants["N_0"]))
        names.append("p")
        validity["N"] = (float(min(used)), float(max(used)))
    x = np.stack(columns, axis=1)
    c, covariance = _weighted(x, value, w)
    residual = float(np.abs(np.exp(x @ c - value) - 1).max())
    # The first coefficient is ln k.
    jacobian = np.diag(np.r_[np.exp(c[0]), np.ones(len(c) - 1)])
    c = np.r_[np.exp(c[0]), c[1:]]
    return BreakageLaw(
        "breakage",
        "S = k phi g P^q" + (" (N/N_0)^p" if "p" in names else ""),
        tuple(names),
        c,
        jacobian @ covariance @ jacobian,
        validity,
        residual,
        f"S of the sizes that make {100 * HELD:g} % of the broken mass, relative",
        constants,
    )


def _daughters(tables: Sequence[KernelTable]) -> DaughtersLaw | None:
    """By maximum likelihood, each fragment with its mass; encounters are what is independent."""
    share, event, count = [], [], 0
    for table in tables:
        r = table.records
        rows = np.isin(r.outcome, SCATTERED)[r.encounter_of_product]
        of = r.encounter_of_product[rows]
        share.append(r.product_size[rows] / r.size.sum(axis=1)[of])
        event.append(of + count)
        count += len(r)
    x, of = np.concatenate(share), np.concatenate(event)
    if np.unique(of).size < FEWEST_BROKEN:
        return None

    def coefficients(t: np.ndarray) -> np.ndarray:
        w, m_1, m_2 = special.expit(t[[0, 1, 3]])
        # a > 1 in both peaks, so that the number of fragments is finite: c > 1/m.
        return np.array([w, m_1, 1.0 / m_1 + np.exp(t[2]), m_2, 1.0 / m_2 + np.exp(t[4])])

    def law(t: np.ndarray) -> TwoBeta:
        return TwoBeta(*map(float, coefficients(t)))

    mean = np.average(x, weights=x)
    start = np.array([0.0, special.logit(0.8 * mean), 1.0, special.logit(min(1.3 * mean, 0.95)), 1.0])
    t, spread = _maximum(lambda t: x * np.log(law(t).mass_density(x)), start, of)
    step = 1e-5
    jacobian = np.stack(
        [(coefficients(t + u) - coefficients(t - u)) / (2 * step) for u in np.eye(5) * step], axis=1
    )
    fitted = law(t)
    return DaughtersLaw(
        "daughters",
        "w beta(x; m_1 c_1, (1 - m_1) c_1) + (1 - w) beta(x; m_2 c_2, (1 - m_2) c_2), mass-weighted",
        ("w", "m_1", "c_1", "m_2", "c_2"),
        coefficients(t),
        jacobian @ spread @ jacobian.T,
        {"x": (0.0, 1.0)},
        _apart(x, fitted.mass_below),
        "mass of fragments below x, of one",
        {
            "mean_number": float(len(x) / np.unique(of).size),
            "mean_number_of_the_law": float(fitted.number_below(np.ones(1))[0]),
        },
    )


def _parts(tables: Sequence[KernelTable]) -> PartsLaw | None:
    """Of parents whose primaries are in more products than one."""
    share, event, count = [], [], 0
    for table in tables:
        r = table.records
        resolved = (r.outcome != UNRESOLVED)[r.encounter_of_product]
        of, first = r.encounter_of_product, r.product_from_first
        for side, own in enumerate((first, r.product_size - first)):
            pieces = np.bincount(of, own > 0, len(r))
            rows = resolved & (pieces[of] > 1) & (own > 0) & (own < r.size[of, side])
            share.append(own[rows] / r.size[of[rows], side])
            event.append(2 * of[rows] + side + count)
        count += 2 * len(r)
    x, of = np.concatenate(share), np.concatenate(event)
    if np.unique(of).size < FEWEST_BROKEN:
        return None

    def scores(t: np.ndarray) -> np.ndarray:
        c = np.exp(t[0])
        return x * stats.beta.logpdf(np.clip(x, 1e-9, 1 - 1e-9), c + 1, c)

    t, spread = _maximum(scores, np.zeros(1), of)
    c = float(np.exp(t[0]))
    return PartsLaw(
        "parts",
        "beta(x; c + 1, c), mass-weighted: two parts, x and 1 - x",
        ("c",),
        np.array([c]),
        spread * c**2,
        {"x": (0.0, 1.0)},
        _apart(x, lambda v: special.betainc(c + 1, c, v)),
        "mass of parts below x, of one",
        {"mean_number": float(len(x) / np.unique(of).size), "events": float(np.unique(of).size)},
    )


def _maximum(
    scores: Callable[[np.ndarray], np.ndarray], start: np.ndarray, event: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the sum of the scores is largest, and the covariance of that, events being independent (sandwich)."""
    size = len(scores(start))
    found = optimize.minimize(lambda t: -scores(t).sum() / size, start, method="BFGS", options={"gtol": 1e-6})
    t, step, m = found.x, 1e-3, len(start)
    unit = np.eye(m) * step
    total = lambda s: scores(s).sum()
    slope = np.stack([(scores(t + u) - scores(t - u)) / (2 * step) for u in unit], axis=1)
    hessian = np.array(
        [
            [total(t + u + v) - total(t + u - v) - total(t - u + v) + total(t - u - v) for v in unit]
            for u in unit
        ]
    ) / (4 * step**2)
    events = np.unique(event, return_inverse=True)[1]
    per_event = np.stack([np.bincount(events, slope[:, k]) for k in range(m)], axis=1)
    inverse = np.linalg.pinv(hessian)
    return t, inverse @ (per_event.T @ per_event) @ inverse


def _apart(x: np.ndarray, below: Callable[[np.ndarray], np.ndarray]) -> float:
    """Largest distance of the mass below x from that of a law, taken in the middle of each step."""
    value, at = np.unique(x, return_inverse=True)
    mass = np.bincount(at, x) / x.sum()
    middle = np.cumsum(mass) - 0.5 * mass
    return float(np.abs(middle - below(value)).max())
