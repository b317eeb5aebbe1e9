"""What breakup leaves, in a run, against the random removal of bonds."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, GREEN, GREY, VERMILION, canvas, legend
from validation import datasets
from validation.case import Case, Context, Findings, above, below, cannot_say, shown

FEWEST = 15
"""Breakups from which shares are taken."""
SMALLEST = 8
"""Smaller parents leave few ways to break."""
DRAWS = 20
COMPARABLE = (0.45, 0.75)


def parts(context: Context):
    return {path.stem: str(path) for path in datasets.runs(context)}


def measure(context: Context, path):
    from mcdem.analysis.breakup import CONVENTIONS, in_convention
    from mcdem.analysis.dataset import RunDataset

    run, rng = RunDataset(path), context.rng(0)
    broken = run.breakups
    whole = broken["parent_size"].values >= SMALLEST
    convention = {name: whole & in_convention(broken, name) for name in CONVENTIONS}
    largest = {name: broken["largest_fragment"].values[rows] for name, rows in convention.items()}
    clusters = [a for k in run.late_snapshots[-10:] for a in run.aggregates(k) if a.size >= SMALLEST]
    sizes = np.array([a.size for a in clusters])
    parents = broken["parent_size"].values[convention["strict"]]
    random = [
        after_random_removal(clusters[rng.choice(np.argsort(np.abs(sizes - parent))[:10])], rng)
        for parent in parents
        for _ in range(DRAWS)
        if len(clusters)
    ]
    return {**largest, "random": random, "stress": run.stress}


def after_random_removal(aggregate, rng) -> float:
    """Share of the largest fragment once bonds, taken away one by one at random, leave two."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    bonds = rng.permutation(aggregate.bonds)
    n, low, high = aggregate.size, 0, len(bonds)

    def labels(kept):
        graph = coo_array((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(n, n))
        return connected_components(graph, directed=False)

    while high - low > 1:  # split once `high` are gone, whole while `low` are
        middle = (low + high) // 2
        low, high = (low, middle) if labels(bonds[middle:])[0] > 1 else (middle, high)
    _, label = labels(bonds[high:])
    return float(np.bincount(label).max() / n)


def judge(context: Context, found):
    from scipy import stats

    from mcdem.analysis.statistics import share

    checks = []
    for name, n in found.items():
        ours, random, paper, own = (np.array(n[key]) for key in ("strict", "random", "paper", "own"))
        if len(ours) < FEWEST or not len(random):
            few = f"{len(ours)} breakups of {SMALLEST} primaries or more, fewer than {FEWEST}"
            checks.append(cannot_say(f"{name}: fragments", few))
            continue

        def portion(values, low, high):
            middle, bottom, top = share(int(((values >= low) & (values <= high)).sum()), len(values))
            return middle, 0.5 * (top - bottom)

        comparable, error = portion(ours, *COMPARABLE)
        by_chance, _ = portion(random, *COMPARABLE)
        eroded, e_eroded = portion(ours, 0.9, 1.0)
        eroded_by_chance, _ = portion(random, 0.9, 1.0)
        wide, e_wide = portion(paper, *COMPARABLE)
        single, e_single = portion(own, *COMPARABLE)
        torn, e_torn = portion(own, 0.9, 1.0)
        distance = stats.ks_2samp(ours, random)
        checks += [
            above(f"{name}: share of largest fragments between 0.45 and 0.75, less that of random removal",
                  comparable - by_chance, 0.2, error=error),
            below(f"{name}: share above 0.9, less that of random removal", eroded - eroded_by_chance, -0.2, error=e_eroded),
            above(f"{name}: Kolmogorov-Smirnov distance between breakup and random removal", distance.statistic, 0.3,
                  error=1.36 / np.sqrt(len(ours))),
            above(f"{name}: share between 0.45 and 0.75, the paper's convention of breakup (printed: more than 0.8)", wide, 0.8,
                  error=e_wide),
            shown(f"{name}: share between 0.45 and 0.75, each aggregate for itself (printed: more than 0.8)", single,
                  error=e_single),
            shown(f"{name}: erosion's share of breakups, strict convention (printed: about 0.1)", eroded, error=e_eroded),
            shown(f"{name}: erosion's share of breakups, each aggregate for itself (printed: about 0.1)", torn, error=e_torn),
        ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=4.8, height=2.8)
        edges = np.linspace(0.0, 1.0, 21)
        whole = [n for n in found.values() if len(n["strict"])]
        for key, colour, words in (
            ("paper", GREY, "two fragments after a collision too"),
            ("strict", BLUE, "what was one piece breaks"),
            ("own", GREEN, "each aggregate for itself"),
            ("random", VERMILION, "random removal of bonds"),
        ):
            values = np.concatenate([n[key] for n in whole]) if whole else np.zeros(0)
            if len(values):
                weights = np.full(len(values), 1.0 / len(values))
                axes.hist(values, edges, weights=weights, histtype="step", color=colour, label=words)
        axes.set(xlabel="largest fragment over parent", ylabel="share")
        if whole:
            legend(axes, loc="upper left")
        return figure

    return Findings(
        tuple(checks), draw, f"Largest fragment over parent, parents of {SMALLEST} primaries or more."
    )


CASE = Case(
    chapter=5,
    claim="Shear breaks aggregates into pieces of comparable size, as the paper prints; the random removal of bonds from the "
    "same aggregates would erode them.",
    source="Frungieri & Vanni 2021, section 3.3 (more than 80 % between 45 and 75 %); random removal of bonds, as in random "
    "binary fragmentation (Drossinos et al. 2019), own; runs: those of --run, else notebooks/data",
    tolerance="differences of shares of 0.2: far beyond what an exchange of which aggregates are taken as parents could do",
    measure=measure,
    judge=judge,
    parts=parts,
    inputs=datasets.runs,
    saved=datasets.runs,
    anew=datasets.RUNS_AGAIN,
    seen=("smallest_for_largest",),
)
