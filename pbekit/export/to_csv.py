"""Plain tables for scripts of one's own: nothing beside the files that every target gets."""

from __future__ import annotations

from pbekit.export.target import Target

TARGET = Target(
    title="plain tables, for a script of your own",
    files=lambda given: {},
    notes={},
    cannot=(
        "Shapes: everything is the mean over them, so that what a size remembers of its shape is left out.",
    ),
    check="Solve the equation above from n_1 = n (all others 0) with pairs.csv and daughters.csv: the mean size must follow "
    "course.csv and come to rest at steady.csv, within their bands.",
)
