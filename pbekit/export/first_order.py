"""What solvers with breakup of first order are given: coefficients of their own forms, and what these come to.

Coefficients are fitted in the logarithm, each pair or size with its share of what happens in the population of the first-order
rates, so that a form that cannot follow the table everywhere follows it where it matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbekit.balance.breakage import BetaSplit
from pbekit.balance.encounters import Aggregation, Breakage
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.export.target import HandOver
from pbekit.solution.steady import NotReachedError, steady_state
from pbekit.study.fitted_form import FittedLaw

HELD = 0.98
"""Share of the aggregated mass in the pairs whose residual is given."""


@dataclass(frozen=True)
class Fit:
    """Coefficients of a target's form.

    Parameters
    ----------
    values : by name
    residual : largest, relative, of what makes `HELD` of the flux
    typical : root of the mean square of the logarithm's residual, by flux
    """

    values: dict[str, float]
    residual: float
    typical: float

    @property
    def words(self) -> str:
        """The residuals, as a page gives them."""
        return f"{100 * self.typical:.0f} % typically, {100 * self.residual:.0f} % at most where {100 * HELD:g} % of it happens"


def pair_flux(given: HandOver) -> np.ndarray:
    """(S, S) mass that aggregates in each pair, per unit volume and time, of classes that encounters were made of."""
    rates = given.rates
    assert rates.first_order is not None
    n, p = rates.first_order.population, rates.pivots
    flux = rates.aggregation_rate.value * np.outer(n, n) * (p[:, None] + p[None])
    return np.where(rates.extrapolated, 0.0, flux)


def size_flux(given: HandOver) -> np.ndarray:
    """(S,) mass that breaks in each size, over the range of the breakage law."""
    rates, law = given.rates, given.laws.breakage
    assert rates.first_order is not None and law is not None
    low, high = law.validity["P"]
    flux = rates.first_order.breakage.value * rates.first_order.population * rates.pivots
    return np.where((rates.pivots >= low) & (rates.pivots <= high), flux, 0.0)


def judged(values: dict[str, float], form: np.ndarray, table: np.ndarray, flux: np.ndarray) -> Fit:
    """A form with its residuals from the table, where there is flux."""
    used = flux > 0
    apart, w = np.log(form[used] / table[used]), flux[used] / flux[used].sum()
    order = np.argsort(-w)
    most = order[: int(np.searchsorted(np.cumsum(w[order]), HELD)) + 1]
    return Fit(values, float(np.abs(np.expm1(apart[most])).max()), float(np.sqrt(w @ apart**2)))


def aggregation_coefficient(given: HandOver, form: np.ndarray) -> Fit:
    """K = C form, (S, S)."""
    flux, table = pair_flux(given), given.rates.aggregation_rate.value
    used = flux > 0
    c = np.exp(np.average(np.log(table[used] / form[used]), weights=flux[used]))
    return judged({"C": float(c)}, c * form, table, flux)


def breakage_coefficient(given: HandOver, ceiling: float, form: np.ndarray) -> Fit:
    """S = ceiling exp(-b form), (S,)."""
    assert given.rates.first_order is not None
    flux, table = size_flux(given), given.rates.first_order.breakage.value
    used = flux > 0
    line = np.log(ceiling / table[used])
    w = flux[used]
    b = float((w * line * form[used]).sum() / (w * form[used] ** 2).sum())
    return judged({"b": b}, ceiling * np.exp(-b * form), table, flux)


def breakage_power(given: HandOver, length: np.ndarray) -> Fit:
    """S = C length^e, (S,)."""
    assert given.rates.first_order is not None
    flux, table = size_flux(given), given.rates.first_order.breakage.value
    used = flux > 0
    e, c = np.polyfit(np.log(length[used]), np.log(table[used]), 1, w=np.sqrt(flux[used]))
    return judged({"C": float(np.exp(c)), "e": float(e)}, np.exp(c) * length**e, table, flux)


def mean_size_of(given: HandOver, kernel: np.ndarray, breakage: np.ndarray, concentration: float) -> float:
    """Steady <P> of an aggregation kernel (S, S), a first-order breakage (S,) and halves of this concentration; nan if none."""
    rates = given.rates
    law = Breakage(np.where(rates.pivots > 1, breakage, 0.0), BetaSplit(concentration))
    balance = PopulationBalance(rates.grid, [Aggregation(kernel), law], edge="closed")
    try:
        n = steady_state(balance, rates.grid.monodisperse(given.primaries)).population
    except (NotReachedError, PBEError):
        return float("nan")
    return float(n @ rates.pivots / n.sum())


def parts_of(given: HandOver) -> FittedLaw:
    """The law of the parts of a parent that breaks; raises `PBEError` without one."""
    if given.laws.parts is None:
        raise PBEError(f"{given.source}: too few aggregates fell apart to say into what")
    return given.laws.parts


def what_it_gives(given: HandOver, kernel: np.ndarray, breakage: np.ndarray, concentration: float) -> str:
    """In words: steady <P> of the target's own forms beside that of the table."""
    rates, parts = given.rates, parts_of(given)
    assert rates.first_order is not None
    table = mean_size_of(
        given, rates.aggregation_rate.value, rates.first_order.breakage.value, parts.coefficient("c")
    )
    forms = mean_size_of(given, kernel, breakage, concentration)
    steady = given.steady_mean_size
    number = lambda v: f"{v:.3g}" if np.isfinite(v) else "none"
    return (
        f"Steady <P> of the balance: {'none' if steady is None else number(steady[0])} from the table; {number(table)} from the "
        f"table's K and S with breakage of first order in two; {number(forms)} from the forms of this dictionary."
    )
