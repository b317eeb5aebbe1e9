"""Do clusters stay fractal in shear where their contacts transmit bending moments?

Fractal trees of primaries (`validation.exact.packings.fractal`) are put into the shear one by one, with the bonds of
scenes/moments-1000Pa.toml that resist sliding and rolling and, as in the paper's scenes, without them.  The table gives the
mass-size exponent d_g of P ~ R_g^d_g, with 95 % limits, over all that there is at the start and after the flow (fragments too,
from four primaries on), the mean coordination number, and into how many pieces the clusters fell.

    python benchmarks/staying_fractal.py [--stress "100 Pa"] [--clusters 4] [--rotations 2] > benchmarks/staying_fractal.md
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import mcdem
from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.statistics import fit_mass_size
from validation.exact.packings import fractal

SCENES = Path(__file__).parent.parent / "scenes"
DIMENSION = 1.8
DOUBLINGS = (2, 3, 4, 5)


def clusters(scene: mcdem.Scene, count: int) -> list[Aggregate]:
    """`count` trees of each size, their contacts at rest."""
    rest = 1.0 + 0.5 * scene.kernels.contact.equilibrium_gap
    found = []
    for doublings in DOUBLINGS:
        for number in range(count):
            positions, bonds = fractal(doublings, DIMENSION, 100 * doublings + number)
            found.append(
                Aggregate.from_positions(scene, rest * scene.suspension.radius * positions, bonds=bonds)
            )
    return found


def after_the_flow(scene: mcdem.Scene, cluster: Aggregate, seed: int) -> list[Aggregate] | None:
    """What a cluster has become, alone but for a primary that passes far away; None if it could not be followed."""
    radius = scene.suspension.radius
    offset = (0.0, cluster.outer_radius(radius) + 7.0 * radius)
    result = mcdem.simulate_encounter(scene, cluster, Aggregate.monomer(), offset=offset, seed=seed)
    if result.outcome == "unresolved":
        return None
    return [
        product
        for product, members in zip(result.products, result.members, strict=True)
        if members[0] < cluster.size
    ]


def row(name: str, scene: mcdem.Scene, made: int, aggregates: list[Aggregate]) -> str:
    """One line of the table."""
    sizes = np.array([a.size for a in aggregates])
    gyration = np.array([np.sqrt((a.positions**2).sum(axis=1).mean()) for a in aggregates])
    fit = fit_mass_size(sizes, gyration, scene.suspension.radius, given="length")
    contacts = sum(len(a.bonds) for a in aggregates if a.size > 1)
    said = "-" if fit is None else f"{fit.exponent:.2f} ({fit.exponent_low:.2f} to {fit.exponent_high:.2f})"
    coordination = 2.0 * contacts / sizes[sizes > 1].sum()
    return f"| {name} | {said} | {coordination:.2f} | {len(aggregates) / made:.2f} | {sizes.max()} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--stress", default="100 Pa")
    parser.add_argument("--clusters", type=int, default=4)
    parser.add_argument("--rotations", type=float, default=2.0)
    options = parser.parse_args()
    changes = {"flow.shear_stress": options.stress, "numerics.rotations": options.rotations}
    bonded, plain = (
        mcdem.load_scene(SCENES / f"{name}-1000Pa.toml").with_changes(changes)
        for name in ("moments", "paper")
    )
    start = clusters(plain, options.clusters)
    print("# Do clusters stay fractal where their contacts transmit torques?\n")
    command = " ".join(["python benchmarks/staying_fractal.py", *sys.argv[1:]])
    print(
        f"By `{command}`: {len(start)} fractal trees of {start[0].size} to {start[-1].size} primaries at {options.stress}, "
        f"{options.rotations:g} rotations.\n"
    )
    print("| | d_g | coordination number | pieces of a cluster | largest |")
    print("|---|---|---|---|---|")
    print(row("at the start", plain, len(start), start), flush=True)
    for name, scene in (("contacts free to slide and roll", plain), ("bonds that transmit torques", bonded)):
        found = [after_the_flow(scene, cluster, k) for k, cluster in enumerate(start)]
        followed = [pieces for pieces in found if pieces is not None]
        print(row(name, scene, len(followed), [piece for pieces in followed for piece in pieces]), flush=True)
        if len(followed) < len(found):
            print(f"\n{len(found) - len(followed)} could not be followed ({name}).\n")


if __name__ == "__main__":
    main()
