"""What each level of hydrodynamics makes of the same encounters: outcomes and time.

Aggregates of a dataset meet as they do in its suspension; each pair starts from the same offset and orientations at every
level, with the scene as it is otherwise.  "other outcome" counts encounters that end otherwise than at the finest level.

    python benchmarks/levels.py SCENE DATASET [--encounters 20]
"""

from __future__ import annotations

import argparse
from collections import Counter

import mcdem
from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.paired_encounters import draw_pairs, level_changes

LEVELS = ("stokesian", "fts", "rotne_prager", "free_draining")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("dataset")
    parser.add_argument("--encounters", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    scene = mcdem.load_scene(options.scene)
    pairs = draw_pairs(scene, [options.dataset], options.encounters, options.seed)
    sizes = sorted(first.size + second.size for first, second in pairs)
    print(
        f"{len(pairs)} encounters of {sizes[0]} to {sizes[-1]} primaries, {sum(sizes) / len(sizes):.1f} on average"
    )
    finest: list[str] = []
    for level in LEVELS:
        changed = scene.with_changes(level_changes(level))
        mcdem.simulate_encounter(changed, Aggregate.monomer(), Aggregate.monomer(), seed=0)  # compiles
        found = [mcdem.simulate_encounter(changed, *pair, seed=k) for k, pair in enumerate(pairs)]
        outcomes = [result.outcome for result in found]
        finest = finest or outcomes
        other = sum(a != b for a, b in zip(outcomes, finest, strict=True))
        time, steps = sum(r.cpu_time for r in found), sum(r.steps for r in found)
        counts = ", ".join(f"{count} {outcome}" for outcome, count in Counter(outcomes).most_common())
        print(
            f"{level:14} {1e3 * time / len(found):9.2f} ms an encounter {steps / len(found):7.0f} steps "
            f"{1e6 * time / steps:8.1f} us a step   other outcome {other:2d}   {counts}",
            flush=True,
        )


if __name__ == "__main__":
    main()
