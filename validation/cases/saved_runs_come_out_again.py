"""Encounters of two primaries from each committed run, followed again by the engine as it is."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, GREY, VERMILION, canvas
from validation import datasets
from validation.case import Case, Context, Findings, above, below

ENCOUNTERS = {True: 300, False: 3000}
"""Followed again of each run, by whether it is quick."""
EDGE = 2e-3
"""How well the engine knows the offset at which hit and miss part, over it (`tests/encounter`)."""


def parts(context: Context):
    return {path.stem: str(path) for path in datasets.runs(context)}


def measure(context: Context, path: str):
    """Of the first encounters of two primaries: outcome and offset [a], as saved and followed again."""
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.analysis.dataset import RunDataset
    from mcdem.encounter.simulate import simulate_encounter
    from mcdem.quantities.random_streams import stream

    run = RunDataset(path)
    events, seed = run.events, int(run.attributes["seed"])
    chosen = np.flatnonzero((events["parent_size"].values == 1).all(axis=1))[: ENCOUNTERS[context.quick]]
    places = zip(events["epoch"].values[chosen], events["stream_number"].values[chosen])
    alone = Aggregate.monomer()
    now = [
        simulate_encounter(run.scene, alone, alone, seed=stream(seed, "encounter", int(epoch), int(number)))
        for epoch, number in places
    ]
    saved = run.outcome[chosen].tolist()

    def at_the_edge(offset) -> bool:
        """Whether hit and miss part within what the engine knows of this offset."""
        sides = [
            simulate_encounter(
                run.scene, alone, alone, offset=tuple(scale * x for x in offset), seed=0
            ).outcome
            for scale in (1.0 - EDGE, 1.0 + EDGE)
        ]
        return sides[0] != sides[1]

    return {
        "saved": saved,
        "at the edge": [a != b.outcome and at_the_edge(b.offset) for a, b in zip(saved, now, strict=True)],
        "now": [one.outcome for one in now],
        "offset saved": events["offset"].values[chosen] / run.radius,
        "offset now": np.array([one.offset for one in now]) / run.radius,
    }


def judge(context: Context, found):
    checks = []
    for label, rows in found.items():
        saved, now = np.array(rows["saved"]), np.array(rows["now"])
        otherwise = (saved != now) & ~np.array(rows["at the edge"])
        drawn = np.abs(np.array(rows["offset now"]) - np.array(rows["offset saved"])).max()
        checks += [
            below(f"{label}: largest difference of an offset from that saved", drawn, 0.1, unit="a"),
            below(f"{label}: of {len(now)} encounters, those that come out otherwise", int(otherwise.sum()), 0.5),
            below(
                f"{label}: those that do within {EDGE:.1%} of the offset at which hit and miss part",
                int(np.sum(rows["at the edge"])),
                0.01 * len(now),
            ),
            above(f"{label}: those among them that stick", int((now == "aggregation").sum()), 5),
        ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=4.5, height=2.6)
        for colour, mark, words, chosen in (
            (GREY, ".", "miss", lambda a, b: (a == b) & (b != "aggregation")),
            (BLUE, ".", "stick", lambda a, b: (a == b) & (b == "aggregation")),
            (VERMILION, "x", "now otherwise", lambda a, b: a != b),
        ):
            points = np.concatenate(
                [
                    np.array(rows["offset now"])[chosen(np.array(rows["saved"]), np.array(rows["now"]))]
                    for rows in found.values()
                ]
            )
            axes.plot(*np.abs(points).T, mark, ms=3, color=colour, label=words)
        axes.set(xlabel="|x₀| / a", ylabel="|y₀| / a")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
        return figure

    return Findings(
        tuple(checks), draw, "Offsets of encounters of two primaries from the runs, by what comes of them."
    )


CASE = Case(
    chapter=8,
    claim="The runs that are saved are of this engine: their encounters of two primaries come out again.",
    source="notebooks/data, whose README says how they were made; versions: the attribute history of each",
    tolerance="none otherwise but within 0.2 % of the offset at which hit and miss part, to which it is known: the motion of two "
    "spheres is not chaotic; offsets to the digits in which they are stored",
    parts=parts,
    measure=measure,
    judge=judge,
    inputs=datasets.runs,
    saved=datasets.runs,
    anew="that is what it does: 300 encounters of each run, in the full mode 3000",
    seen=("weak_attraction",),
)
