"""The population balance against exact solutions."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import CYCLE, MARKERS, canvas, legend
from validation.case import Case, Context, Findings, below, between

RATIOS = 2 ** np.array([1.0, 0.5, 0.25, 0.125])
SCHEMES = ("fixed pivot", "cell average", "three pivots")
GOLOVIN_TIME, SCISSION_TIME = 1.0, 3.0


def parts(context: Context):
    ratios = RATIOS[:3] if context.quick else RATIOS
    return {"whole primaries": None} | {
        f"{scheme}, ratio {r:.4g}": [scheme, float(r)] for scheme in SCHEMES for r in ratios
    }


def measure(context: Context, part):
    return whole_primaries() if part is None else continuous(*part)


def whole_primaries():
    """Largest error of n_k, per N0, on the grid of whole primaries."""
    from pbekit import Aggregation, Breakage, Grid, PopulationBalance, exact, integrate
    from pbekit.balance.breakage import PowerLawRate, Uniform
    from pbekit.balance.kernels import Constant, Product, Sum

    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-16}
    errors = {}
    for kernel in (Constant(1.3), Sum(0.7), Product(0.9)):
        grid, time, number = Grid.primaries(100), 0.35, 1.4
        balance = PopulationBalance(grid, [Aggregation(kernel)])
        found = integrate(balance, grid.monodisperse(number), [0, time], **tight)[-1, : grid.cells]
        wanted = kernel.exact_discrete(grid.pivots, time, number)
        errors[f"aggregation from primaries, {kernel.name}"] = np.abs(found - wanted).max() / number
    length, number, rate, time = 30, 2.0, 0.8, 0.5
    grid = Grid.primaries(length)
    balance = PopulationBalance(grid, [Breakage(PowerLawRate(rate, 1, offset=1), Uniform())])
    found = integrate(balance, grid.monodisperse(number, length), [0, time], **tight)[-1, :length]
    wanted = exact.chain_scission(grid.pivots, time, number, length, rate)
    errors["scission of a chain (Montroll & Simha 1940)"] = np.abs(found - wanted).max() / number
    number, rate, bond = 1.0, 2.0, 0.3
    grid = Grid.primaries(60)
    events = [Aggregation(Constant(rate)), Breakage(PowerLawRate(bond, 1, offset=1), Uniform())]
    balance = PopulationBalance(grid, events, edge="closed")
    for time, when in ((2.0, "on the way"), (40.0, "steady")):
        found = integrate(balance, grid.monodisperse(number), [0, time], **tight)[-1, :60]
        wanted = exact.chain_bonding(grid.pivots, time, number, rate, bond)
        errors[f"bonds that form and break, {when} (Blatz & Tobolsky 1945)"] = (
            np.abs(found - wanted).max() / number
        )
    return errors


def continuous(scheme: str, ratio: float):
    """Relative errors of the second moment, and of mass, for Golovin's kernel and for random scission."""
    from pbekit import Aggregation, Breakage, Grid, PopulationBalance, integrate
    from pbekit.balance.breakage import PowerLawRate, Uniform
    from pbekit.balance.kernels import Sum, exponential_below

    kernel = Sum(1.0)
    cases = {
        "Golovin": ([Aggregation(kernel)], GOLOVIN_TIME, kernel.exact_moments(GOLOVIN_TIME, 1.0, 1.0)[2]),
        "random scission": ([Breakage(PowerLawRate(1.0), Uniform())], SCISSION_TIME, 2 / (1 + SCISSION_TIME)),
    }
    found = {}
    for name, (events, time, second) in cases.items():
        grid = Grid.geometric(1e-4, 1e3, ratio)
        balance = PopulationBalance(grid, events, scheme)
        start = grid.from_cumulative(*exponential_below(1, 1), scheme)
        state = integrate(balance, start, [0, time], rtol=1e-9, atol=1e-14)[-1]
        mass = abs(state @ balance.conserved / (start @ grid.masses) - 1).max()
        found[name] = [state[: grid.cells] @ grid.pivots**2 / second - 1, mass]
    return found


def judge(context: Context, found):
    checks = [
        below(f"{name}: largest error of n_k/N0", error, 1e-8)
        for name, error in found.pop("whole primaries").items()
    ]
    ratios = RATIOS[: len(found) // len(SCHEMES)]
    errors = {}
    for scheme in SCHEMES:
        rows = [found[f"{scheme}, ratio {r:.4g}"] for r in ratios]
        for name in ("Golovin", "random scission"):
            errors[name, scheme] = np.abs([row[name][0] for row in rows])
            said = f"{name}, {scheme}"
            checks.append(below(f"{said}: mass lost", max(row[name][1] for row in rows), 1e-12))
            if scheme == "fixed pivot":
                finest, width = errors[name, scheme][-2:], np.log(ratios[-2:])
                order = np.log(finest[0] / finest[1]) / np.log(width[0] / width[1])
                checks.append(between(f"{said}: order of the second moment", order, 1.7, 2.3))
            checks.append(
                below(f"{said}: error of the second moment, finest grid", errors[name, scheme][-1], 0.08)
            )

    def draw():
        figure, axes = canvas(width=4.5, height=3.0)
        for k, ((name, scheme), some) in enumerate(errors.items()):
            axes.loglog(np.log(ratios), some, MARKERS[k] + ("-" if "pivot" in scheme else "--"), ms=4, mfc="none",
                        color=CYCLE[k], label=f"{name}, {scheme}")  # fmt: skip
        axes.loglog(np.log(ratios), 0.3 * np.log(ratios) ** 2, "k:", label="second order")
        axes.set(xlabel="ln of the grid's ratio", ylabel="error of the second moment")
        legend(axes)
        return figure

    return Findings(tuple(checks), draw, "Error of the second moment against the width of the cells.")


CASE = Case(
    chapter=7,
    claim="The population balance solves whole primaries to eight digits and continuous sizes to second order, and loses no "
    "mass.",
    source="Smoluchowski 1917; Golovin 1963; McLeod 1962; Montroll & Simha 1940; Blatz & Tobolsky 1945; Ziff & McGrady 1985",
    tolerance="1e-8 where the grid is exact, as tight as the integrator; order 1.7 to 2.3 for a method of second order; 1e-12 of "
    "the mass, round-off",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("aggregation_half",),
)
