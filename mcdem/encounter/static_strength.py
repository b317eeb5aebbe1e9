"""How strong aggregates are: the largest tension of their contacts as they turn rigidly, from statics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import Aggregate, radii_of
from mcdem.arguments import scene_at_door
from mcdem.encounter.motion import analysed
from mcdem.encounter.simulate import physics_of, springs_of
from mcdem.integrators.state import Motion
from mcdem.rigid_aggregates.statics import worst_load
from mcdem.scene import Scene


def worst_loads(scene: Scene, aggregates: Sequence[Aggregate]) -> NDArray[np.float64]:
    """(A,) largest ratio of tension to pull-off force over the contacts of each and all its orientations in the flow.

    nan for aggregates with floppy modes, and for single primaries.  Each is alone in the flow and turns freely; above 1 it
    breaks in some orientation.  Tensions are those of statics in a network that is rigid (Maxwell 1864; redundant bonds by
    their stiffness), loaded by the drag at the scene's level of hydrodynamics.

    Parameters
    ----------
    scene : Scene
        Whose flow, contacts and level of hydrodynamics are taken.
    aggregates : sequence of Aggregate
        A of them.

    Returns
    -------
    (A,) array
        [-].

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.aggregates import straight_chain
    >>> from mcdem.encounter import worst_loads
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")

    A doublet bears less than half of the force that would part it:

    >>> worst_loads(scene, [straight_chain(scene, 2)]).round(3).tolist()
    [0.373]
    """
    scene_at_door(scene)
    aggregates = [Aggregate.at_door(scene, a, str(k)) for k, a in enumerate(aggregates)]
    flow, physics = physics_of(scene)
    found = np.full(len(aggregates), math.nan)
    for k, aggregate in enumerate(aggregates):
        if aggregate.size < 2:
            continue
        positions = np.ascontiguousarray(aggregate.positions) / scene.reduced.length
        radii = radii_of(scene, aggregate.radii, aggregate.size)
        count = aggregate.size
        alone = Motion(
            positions,
            np.zeros_like(positions),
            aggregate.contact_network(),
            np.full((count, count), -math.inf),
            np.ones(count) if radii is None else radii / scene.reduced.length,
            np.zeros(count, np.int64),
            springs_of([aggregate]) if scene.effects.resisting else None,
        )
        body, _ = analysed(alone, physics)
        if body is not None:
            found[k] = worst_load(body, flow.strain_five)
    return found
