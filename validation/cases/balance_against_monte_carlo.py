"""The population balance on a run's encounters beside that run: mean size over time, and sizes late in the run."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLACK, BLUE, VERMILION, canvas, legend
from validation import datasets
from validation.case import Case, Context, Findings, above, near, shown

SERIES = ("mean_size", "size_deviation", "sauter_diameter")
LEAST = 0.02
"""Of ranks among single runs: a right balance fails a check once in fifty tables."""
LATE = 0.6


def measure(context: Context):
    """The run, the balance, and single runs to come that the balance's table leaves open, over the same times."""
    from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
    from pbekit.solution.finite_population import population_course
    from pbekit.study.uncertainty import course_output

    table, run = datasets.kernels(), datasets.series()
    times = np.linspace(0.0, run.time[-1], 81)
    estimated = EstimatedRates(table, grid_for(table))
    balance = course_output(start_of(estimated.grid, table), times, rtol=1e-5)(estimated.mean)
    single = population_course(
        estimated, float(table.about["volume_fraction"]), times, initial=run.initial, replicas=60 if context.quick else 400,
        seed=context.seed, steady_from=LATE * times[-1], drawn=True,
    )  # fmt: skip
    late = times >= LATE * times[-1]
    sizes = 41
    snapshots = np.append(run.share, np.zeros(max(0, sizes - len(run.share))))[:sizes]
    return {
        "times": times,
        "late": late,
        "run": {name: run.at(name, times) for name in SERIES},
        "balance": {name: balance[name] for name in SERIES},
        "single": {name: single[name].values for name in SERIES},
        "share": snapshots,
        "shares": single["share"].values[:, :sizes],
    }


def rank(one: np.ndarray, several: np.ndarray) -> float:
    """Share of `several` (n, ...) that lie as far from their mean as `one`, or further, by the largest scaled deviation."""
    middle, spread = several.mean(axis=0), several.std(axis=0, ddof=1)
    # At the start all are alike; the run's reals are rounded to 1e-4 (`mcdem compress`).
    used = spread > 1e-3 * np.abs(middle).max()
    # Each is compared with the mean of all others and itself, as the run is.
    far = lambda x: np.abs((x - middle)[..., used] / spread[used]).max(axis=-1)
    return float((1 + (far(several) >= far(one)).sum()) / (1 + len(several)))


def judge(context: Context, found):
    times, late = np.array(found["times"]), np.array(found["late"])
    checks = []
    for name, said in zip(SERIES, ("mean size", "standard deviation of sizes", "Sauter diameter")):
        run, single, balance = (np.array(found[which][name]) for which in ("run", "single", "balance"))
        checks += [
            above(f"{said} over time: share of single runs to come that stray as far from their mean as the run",
                  rank(run, single), LEAST),
            near(f"{said}, late: run over balance", run[late].mean() / balance[late].mean(), 1.0, abs=0.15),
            shown(f"{said}, late: spread of single runs", single[:, late].mean(axis=1).std(ddof=1) / balance[late].mean()),
        ]  # fmt: skip
    share, shares = np.array(found["share"]), np.array(found["shares"])
    middle = shares.mean(axis=0)
    distances = 0.5 * np.abs(shares - middle).sum(axis=1)
    distance = 0.5 * float(np.abs(share - middle).sum())
    checks += [
        above("sizes late in the run: share of single runs whose sizes are as far from their mean",
              float((1 + (distances >= distance).sum()) / (1 + len(distances))), LEAST,
              why=f"distance {distance:.3f}: the share of aggregates that would have to change size"),
    ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=7.0, height=2.8, ncols=2)
        low, high = np.quantile(np.array(found["single"]["mean_size"]), [0.05, 0.95], axis=0)
        axes[0].fill_between(
            times, low, high, color=BLUE, alpha=0.2, lw=0, label="90 % of single runs to come"
        )
        axes[0].plot(times, found["balance"]["mean_size"], color=BLUE, label="balance")
        axes[0].plot(times, found["run"]["mean_size"], color=VERMILION, lw=0.9, label="Monte Carlo")
        axes[0].set(xlabel="time (s)", ylabel="mean size ⟨P⟩")
        legend(axes[0])
        at = np.arange(len(share))[1:31]
        low, high = np.quantile(shares, [0.05, 0.95], axis=0)
        axes[1].bar(at, share[1:31], color=VERMILION, alpha=0.5, label="Monte Carlo")
        axes[1].vlines(at, low[1:31], high[1:31], color=BLACK, lw=0.7)
        axes[1].plot(at, middle[1:31], "o", ms=2.5, color=BLACK, label="balance in samples as large")
        axes[1].set(xlabel="primaries P", ylabel="share of aggregates")
        legend(axes[1], f"from {LATE * times[-1]:.0f} s on; bars: 90 %")
        return figure

    return Findings(
        tuple(checks),
        draw,
        "The balance on the tabulated encounters of a run at 1000 Pa, and that run.",
    )


CASE = Case(
    chapter=7,
    claim="The balance on a run's tabulated encounters gives that run's sizes back: the run cannot be told from a single run of "
    "the balance's own rules in a sample as large.",
    source="notebooks/data: the longest run at 1000 Pa, and the table of its encounters with designed ones (README there); "
    "rules: pbekit/estimated_rates/estimated_rates.py, drawn one at a time by pbekit/solution/finite_population.py",
    tolerance="a rank among single runs above 2 %; late means within 15 %, some four times the scatter of single runs",
    measure=measure,
    judge=judge,
    inputs=lambda context: (datasets.DESIGNED, datasets.SERIES),
    saved=lambda context: (datasets.DESIGNED, datasets.SERIES),
    anew=datasets.RUNS_AGAIN,
    seen=("clock_slow",),
)
