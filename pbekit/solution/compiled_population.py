"""A finite population, compiled: encounters drawn one at a time with the estimated rates.

All kernels of it stand in this file, and call nothing outside it, so numba's own cache check sees every edit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Lookup(NamedTuple):
    """What a finite population needs to know of estimated rates.

    cell (largest + 1, shapes + 1): cell of a size and shape (last column: the one of sizes with one shape)
    moments (3, K): of R; outcome (K, K, 2): probability to survive, to survive or join
    pair_size (largest + 1,): size index; near_*: scattered encounters of each pair of sizes, cumulative weights
    event_*: products of each scattered encounter; joined (groups, K), scattered (K,), kept (G, K, shapes): cumulative
    shapes; group_of_cell (K,) of partners
    """

    cell: np.ndarray
    moments: np.ndarray
    outcome: np.ndarray
    size_index: np.ndarray
    near_start: np.ndarray
    near_event: np.ndarray
    near_weight: np.ndarray
    event_start: np.ndarray
    event_size: np.ndarray
    joined: np.ndarray
    scattered: np.ndarray
    kept: np.ndarray
    group_of_cell: np.ndarray
    shape_of_cell: np.ndarray
    first_cell: np.ndarray
    rate: float


class Population(NamedTuple):
    """Aggregates in a volume: sizes, shapes (capacity,), `number` of them; doubled when fewer than `keep` are left."""

    sizes: np.ndarray
    shapes: np.ndarray
    number: int
    volume: float
    keep: int


class Samples(NamedTuple):
    """What is taken down of a population.

    series (times, 6) number, volume, sums of P, P^2, R^2 and R^3; histogram (largest + 1,) counts of sizes over the samples from
    `counted_from` on
    """

    series: np.ndarray
    histogram: np.ndarray
    counted_from: int


@njit(cache=True)
def _pick(cumulative, rng):
    """Index drawn from cumulative probabilities that end at one."""
    drawn, low, high = rng.random(), 0, cumulative.size - 1
    while low < high:
        middle = (low + high) // 2
        if cumulative[middle] > drawn:
            high = middle
        else:
            low = middle + 1
    return low


@njit(cache=True)
def _cell_of(lookup, size, shape):
    """Cell of an aggregate; sizes beyond the table of sizes count as the largest."""
    at = min(size, lookup.cell.shape[0] - 1)
    return lookup.cell[at, shape]


@njit(cache=True)
def _shaped(lookup, rows, size, rng):
    """A shape for a product of this size, from rows (K,) that hold each cell's cumulative share of its size."""
    shapes = lookup.cell.shape[1] - 1
    first = _cell_of(lookup, size, 0)
    if shapes == 1 or lookup.shape_of_cell[first] < 0:
        return shapes
    return _pick(rows[first : first + shapes], rng)


@njit(cache=True)
def _place(lookup, population, cells, k, size, shape):
    """Put an aggregate at place k; returns its mean cube of the radius."""
    population.sizes[k], population.shapes[k] = size, shape
    cells[k] = _cell_of(lookup, size, shape)
    return lookup.moments[2, cells[k]]


@njit(cache=True)
def _take_down(lookup, population, cells, number, volume, sample, samples):
    """Enter a population of `number` aggregates into the samples."""
    row, histogram, m = samples.series[sample], samples.histogram, lookup.moments
    row[0], row[1] = number, volume
    for k in range(number):
        size = population.sizes[k]
        row[2] += size
        row[3] += size**2
        row[4] += m[1, cells[k]]
        row[5] += m[2, cells[k]]
        if sample >= samples.counted_from:
            histogram[min(size, histogram.size - 1)] += 1


@njit(cache=True)
def finite_population(lookup, population, times, rng, samples):
    """Event-driven Monte Carlo on estimated rates: the balance's own rates in a finite, doubling population.

    times (t,) [s] at which `samples` are taken; sizes and shapes of `population` are changed.  Returns the number of encounters.
    """
    m = lookup.moments
    sizes, shapes = population.sizes, population.shapes
    number, volume, keep = population.number, population.volume, population.keep
    time, sample, met = 0.0, 0, 0
    pieces = np.empty(512, np.int64)
    cells = np.empty(sizes.size, np.int64)
    for k in range(number):
        _place(lookup, population, cells, k, sizes[k], shapes[k])
    largest = -1.0  # mean cube of a radius in the population; below 0 where it has to be sought
    while sample < times.size:
        if largest < 0.0:
            for k in range(number):
                largest = max(largest, m[2, cells[k]])
        bound = lookup.rate * 8.0 * largest
        total = 0.5 * number * (number - 1) * bound / volume
        while True:
            time += rng.standard_exponential() / total
            while sample < times.size and times[sample] < time:
                _take_down(lookup, population, cells, number, volume, sample, samples)
                sample += 1
            if sample == times.size:
                return met
            i, j = int(number * rng.random()), int((number - 1) * rng.random())
            if j >= i:
                j += 1
            a, b = cells[i], cells[j]
            cube = m[2, a] + 3 * m[1, a] * m[0, b] + 3 * m[0, a] * m[1, b] + m[2, b]
            if rng.random() * bound < lookup.rate * cube:
                break
        met += 1
        left = max(m[2, a], m[2, b])
        new = 0.0
        draw = rng.random()
        if draw < lookup.outcome[a, b, 0]:
            for one, c, d in ((i, a, b), (j, b, a)):
                if lookup.shape_of_cell[c] >= 0:
                    shape = _pick(lookup.kept[lookup.group_of_cell[d], c], rng)
                    new = max(new, _place(lookup, population, cells, one, sizes[one], shape))
                else:
                    new = max(new, m[2, c])
            largest = new if new >= largest else -1.0 if left == largest else largest
            continue
        joint = sizes[i] + sizes[j]
        count = 0
        if draw < lookup.outcome[a, b, 1]:
            larger = a if sizes[i] > sizes[j] else b
            if sizes[i] == sizes[j] and lookup.shape_of_cell[a] > lookup.shape_of_cell[b]:
                larger = a
            group = min(lookup.shape_of_cell[larger] + 1, lookup.joined.shape[0] - 1)
            shape = _shaped(lookup, lookup.joined[group], joint, rng)
            new = _place(lookup, population, cells, i, joint, shape)
        else:
            top = lookup.size_index.size - 1
            p, q = lookup.size_index[min(sizes[i], top)], lookup.size_index[min(sizes[j], top)]
            pair = max(p, q) * (max(p, q) + 1) // 2 + min(p, q)
            low, high = lookup.near_start[pair], lookup.near_start[pair + 1]
            event = lookup.near_event[low + _pick(lookup.near_weight[low:high], rng)]
            count = _scaled(
                lookup.event_size[lookup.event_start[event] : lookup.event_start[event + 1]],
                joint,
                pieces,
                rng,
            )
            shape = _shaped(lookup, lookup.scattered, pieces[0], rng)
            new = _place(lookup, population, cells, i, pieces[0], shape)
            for k in range(2, count):
                shape = _shaped(lookup, lookup.scattered, pieces[k], rng)
                new = max(new, _place(lookup, population, cells, number, pieces[k], shape))
                number += 1
        if count > 1:
            shape = _shaped(lookup, lookup.scattered, pieces[1], rng)
            new = max(new, _place(lookup, population, cells, j, pieces[1], shape))
        else:
            number -= 1
            _place(lookup, population, cells, j, sizes[number], shapes[number])
        if number < keep:
            for k in range(number):
                sizes[number + k], shapes[number + k], cells[number + k] = sizes[k], shapes[k], cells[k]
            number *= 2
            volume *= 2.0
        largest = new if new >= largest else -1.0 if left == largest else largest
    return met


@njit(cache=True)
def _scaled(fragments, joint, out, rng):
    """Fragments of a similar encounter made whole primaries of `joint` in all: monomers and dimers stay, the rest is scaled.

    Rounding is up or down by chance, as a pivot's neighbours share a fragment between them; the largest holds the rest.
    Returns how many there are.
    """
    light, heavy = 0, 0
    for f in fragments:
        if f <= 2:
            light += f
        else:
            heavy += f
    room = joint - light
    if heavy == 0 or room < 3:
        # No room for larger pieces: all are scaled; monomers and dimers alone are as small in any pair.  As many as it takes.
        factor = 1.0 if heavy == 0 else joint / (light + heavy)
        left, count = joint, 0
        while left > 0:
            f = fragments[count % fragments.size]
            size = min(max(1, int(f * factor + rng.random())), joint - 1, left)
            if count == out.size - 1:
                size = left
            out[count] = size
            left -= size
            count += 1
        return count
    left, count, most = joint, 0, 0
    for f in fragments:
        size = f if f <= 2 else max(1, int(f * room / heavy + rng.random()))
        out[count] = size
        left -= size
        if out[count] > out[most]:
            most = count
        count += 1
    out[most] += left
    if out[most] < 1:
        # Rounding took more than there is.
        out[0], out[1] = joint - 1, 1
        return 2
    return count
