"""Makes encounter_starts.npz: 32 encounters of aggregates of 2 to 8 primaries on which schemes of integration are compared.

    python tests/data/make_encounter_starts.py

The aggregates grow from primaries by encounters of the paper's suspension at 1000 Pa, so that their contacts have settled in
the flow.  Offsets follow the flux through a circle of half the radius R_i + R_j, so that many of them touch.  Nothing
is chosen by outcome.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import mcdem
from mcdem.quantities.linear_flows import draw_offset

COUNT = 32
SMALLEST, LARGEST = 2, 8
HERE = Path(__file__).parent
SCENE = HERE.parent.parent / "scenes" / "paper-1000Pa.toml"


def grow(scene: mcdem.Scene, rng: np.random.Generator) -> list[mcdem.Aggregate]:
    """Aggregates of every size from 2 to 8, several of each."""
    pool = [mcdem.Aggregate.monomer()]
    while min(sum(a.size == size for a in pool) for size in range(SMALLEST, LARGEST + 1)) < 3:
        i, j = (pool[rng.integers(len(pool))] for _ in range(2))
        if i.size + j.size > LARGEST:
            continue
        reach = i.outer_radius(scene.suspension.radius) + j.outer_radius(scene.suspension.radius)
        result = mcdem.simulate_encounter(scene, i, j, draw_offset(scene.flow, 0.5 * reach, rng), seed=rng)
        if result.outcome == "aggregation" and sum(a.size == i.size + j.size for a in pool) < 3:
            pool.append(result.products[0])
    return [a for a in pool if a.size >= SMALLEST]


def main() -> None:
    """Write the starts: primaries one after the other, contacts as pairs of their numbers within the aggregate."""
    scene = mcdem.load_scene(SCENE)
    rng = np.random.default_rng(2021)
    pool = grow(scene, rng)
    sizes, positions, bonds, bond_counts, offsets = [], [], [], [], []
    for _ in range(COUNT):
        pair = [pool[rng.integers(len(pool))].turned(rng) for _ in range(2)]
        reach = sum(a.outer_radius(scene.suspension.radius) for a in pair)
        offsets.append(draw_offset(scene.flow, 0.5 * reach, rng))
        for aggregate in pair:
            sizes.append(aggregate.size)
            positions.append(aggregate.positions)
            bonds.append(aggregate.bonds)
            bond_counts.append(len(aggregate.bonds))
    np.savez_compressed(
        HERE / "encounter_starts.npz",
        sizes=np.array(sizes).reshape(COUNT, 2),
        positions=np.concatenate(positions),
        bonds=np.concatenate(bonds),
        bond_counts=np.array(bond_counts).reshape(COUNT, 2),
        offsets=np.array(offsets),
    )


if __name__ == "__main__":
    main()
