"""The compiled balance: right-hand side and Jacobian of the event form.

    dn_k/dt = sum over pairs {i, j} of f_ij n_i n_j / (1 + delta_ij) * (<nu_k>_ij - delta_ki - delta_kj) + first order

All kernels of it stand in this one file, and call nothing outside it, so numba's own cache check sees every edit.

How events become products, in three steps: cells meet (weights over pairs of cells), the products of a pair are a
row over *slots* (pairs of classes choose a row; a class is a run of cells of one size whose products are alike),
slots become cells (a row of shapes per size and kind of event).  A slot is (kind of event v, size p).

Inner loops run over slices from zero on, or from max(begin, 0): an index that could be negative would be wrapped, and
that forbids vector instructions.

Legend: K cells, C classes, E kinds of pair event, V variants of product shapes, S sizes, T overflow entries
(number and masses), W = S + T slots per variant.  The state is (n_1 ... n_K, overflow).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}


class Geometry(NamedTuple):
    """How cells, classes, sizes and slots hang together."""

    class_start: np.ndarray  # (C + 1,) int64, cells of class c are class_start[c] ... class_start[c + 1] - 1
    size_of_cell: np.ndarray  # (K,) int64
    share: np.ndarray  # (V, K) probability of the cell's shape, given a product's size and kind
    mass: np.ndarray  # (K,) pivots, used by the cell average
    up: np.ndarray  # (K,) int64 neighbour of next larger size, -1 none
    down: np.ndarray  # (K,) int64 neighbour of next smaller size
    tail: int  # T


class Products(NamedTuple):
    """Rows of products over slots, each row in runs of neighbouring slots."""

    row: np.ndarray  # (rows + 1,) int64 first run of each row
    run: np.ndarray  # (runs + 1,) int64 first entry of each run
    slot: np.ndarray  # (runs,) int64 slot of that entry
    number: np.ndarray  # (nnz,) products of the event that fall on each slot
    carried: np.ndarray  # (nnz,) the mass they carry; (0,) unless cell average


class Encounters(NamedTuple):
    """Events of two aggregates, both of which are consumed."""

    weight: np.ndarray  # (E, K, K) rate times probability of the event, symmetric
    row: np.ndarray  # (E, C (C + 1) / 2) int64 row of products of classes A <= B, at B (B + 1) / 2 + A
    products: Products


class FirstOrder(NamedTuple):
    """Events of one aggregate, which is consumed."""

    rate: np.ndarray  # (K,)
    products: Products  # one row a cell


class Restructuring(NamedTuple):
    """Encounters after which an aggregate keeps its size but not its shape."""

    rate: np.ndarray  # (K, K) rate at which i meets j and both survive
    partner_start: np.ndarray  # (G + 1,) int64 groups of partners (runs of cells) with their own transitions
    first_cell: np.ndarray  # (K,) int64 first cell of the cell's size
    shapes: np.ndarray  # (K,) int64 cells of the cell's size
    transition: np.ndarray  # (G, K, most shapes) probability of the shape after


# What a balance lacks is there without entries, so that one compiled function serves every balance.
NO_PRODUCTS = Products(
    np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
)
NO_ENCOUNTERS = Encounters(np.zeros((0, 0, 0)), np.zeros((0, 0), np.int64), NO_PRODUCTS)
NO_FIRST_ORDER = FirstOrder(np.zeros(0), NO_PRODUCTS)
NO_RESTRUCTURING = Restructuring(
    np.zeros((0, 0)),
    np.zeros(1, np.int64),
    np.zeros(0, np.int64),
    np.zeros(0, np.int64),
    np.zeros((0, 0, 0)),
)


@njit(cache=True, fastmath=FAST)
def _add_products(products, rows, frequency, slots, slot_mass):
    """Add the products of events to the slots: those of row rows[k] at frequency[k]."""
    averaged = slot_mass.size > 0
    for k in range(rows.size):
        if frequency[k] == 0.0:
            continue
        for q in range(products.row[rows[k]], products.row[rows[k] + 1]):
            begin, slot = max(products.run[q], 0), max(products.slot[q], 0)
            length = products.run[q + 1] - begin
            if averaged:
                for r in range(length):
                    slots[slot + r] += frequency[k] * products.number[begin + r]
                    slot_mass[slot + r] += frequency[k] * products.carried[begin + r]
            else:
                for r in range(length):
                    slots[slot + r] += frequency[k] * products.number[begin + r]


@njit(cache=True, fastmath=FAST)
def _pair_rates(n, class_start, encounters, slots, slot_mass, consumed):
    """Add the products of all pair events to the slots, and the frequency of events to `consumed` (K,)."""
    weight, row, products = encounters.weight, encounters.row, encounters.products
    classes = class_start.size - 1
    partial = np.empty(n.size)
    events = np.zeros(products.row.size - 1)
    for e in range(weight.shape[0]):
        for b in range(classes):
            begin, end = max(class_start[b], 0), max(class_start[b + 1], 0)
            for i in range(end):
                partial[i] = 0.0
            # One pass over the rows of class b up to its diagonal block serves both partners.
            for j in range(begin, end):
                nj, seen = n[j], 0.0
                for i in range(end):
                    partial[i] += weight[e, j, i] * nj
                for i in range(begin):
                    seen += weight[e, j, i] * n[i]
                consumed[j] += seen
            for i in range(end):
                consumed[i] += partial[i]
                partial[i] *= n[i]
            if classes == n.size:
                # One cell a class: nothing to sum.
                partial[b] *= 0.5
                for a in range(b + 1):
                    events[row[e, b * (b + 1) // 2 + a]] += partial[a]
                continue
            for a in range(b + 1):
                frequency = 0.0
                for i in range(max(class_start[a], 0), class_start[a + 1]):
                    frequency += partial[i]
                events[row[e, b * (b + 1) // 2 + a]] += 0.5 * frequency if a == b else frequency
    rows = np.empty(events.size, np.int64)
    for k in range(events.size):
        rows[k] = k
    _add_products(products, rows, events, slots, slot_mass)


@njit(cache=True)
def _first_order_rates(n, first_order, slots, slot_mass, consumed):
    rate = first_order.rate
    rows, frequency = np.empty(rate.size, np.int64), np.empty(rate.size)
    for k in range(rate.size):
        consumed[k] += rate[k]
        rows[k], frequency[k] = k, rate[k] * n[k]
    _add_products(first_order.products, rows, frequency, slots, slot_mass)


@njit(cache=True, fastmath=FAST)
def _restructure(n, restructuring, out):
    start = restructuring.partner_start
    for i in range(restructuring.first_cell.size):
        first = restructuring.first_cell[i]
        after = out[first : first + restructuring.shapes[i]]
        for g in range(start.size - 1):
            partners, rate = n[start[g] : start[g + 1]], restructuring.rate[i, start[g] : start[g + 1]]
            seen = 0.0
            for j in range(partners.size):
                seen += rate[j] * partners[j]
            seen *= n[i]
            out[i] -= seen
            probability = restructuring.transition[g, i]
            for s in range(after.size):
                after[s] += seen * probability[s]


@njit(cache=True)
def _births(geometry, slots, slot_mass, out, birth_mass):
    """Slots to cells; with the cell average, the birth of each cell is then put on two pivots."""
    cells, variants = geometry.size_of_cell.size, geometry.share.shape[0]
    width = slots.size // variants
    averaged = slot_mass.size > 0
    for v in range(variants):
        for k in range(cells):
            at = v * width + geometry.size_of_cell[k]
            out[k] += slots[at] * geometry.share[v, k]
            if averaged:
                birth_mass[k] += slot_mass[at] * geometry.share[v, k]
        for t in range(geometry.tail):
            out[cells + t] += slots[v * width + width - geometry.tail + t]


@njit(cache=True)
def _average_target(geometry, k, number, mass):
    """The neighbour that shares the birth of cell k, and whether there is one."""
    if mass >= geometry.mass[k] * number:
        return geometry.up[k]
    return geometry.down[k]


@njit(cache=True)
def _spread(geometry, number, mass, out):
    """Cell average (Kumar et al. 2006): number and mean mass of the births of a cell decide where they go."""
    for k in range(number.size):
        if number[k] == 0.0 and mass[k] == 0.0:
            continue
        other = _average_target(geometry, k, number[k], mass[k])
        x = geometry.mass[k]
        if other < 0:
            out[k] += mass[k] / x
        else:
            moved = (mass[k] - x * number[k]) / (geometry.mass[other] - x)
            out[k] += number[k] - moved
            out[other] += moved


@njit(cache=True)
def right_hand_side(n, geometry, encounters, first_order, restructuring, averaged, out):
    """dn/dt of the state (K + T,) into `out`."""
    cells = geometry.size_of_cell.size
    variants = geometry.share.shape[0]
    width = geometry.tail + geometry.size_of_cell[-1] + 1
    slots = np.zeros(variants * width)
    slot_mass = np.zeros(slots.size if averaged else 0)
    consumed = np.zeros(cells)
    population = n[:cells]
    _pair_rates(population, geometry.class_start, encounters, slots, slot_mass, consumed)
    _first_order_rates(population, first_order, slots, slot_mass, consumed)
    for k in range(out.size):
        out[k] = 0.0
    if averaged:
        births, birth_mass = np.zeros(cells + geometry.tail), np.zeros(cells)
        _births(geometry, slots, slot_mass, births, birth_mass)
        _spread(geometry, births[:cells], birth_mass, out)
        for t in range(cells, out.size):
            out[t] += births[t]
    else:
        _births(geometry, slots, slot_mass, out, slot_mass)
    for k in range(cells):
        out[k] -= consumed[k] * population[k]
    _restructure(population, restructuring, out)


@njit(cache=True, fastmath=FAST)
def _pair_slopes(n, class_start, encounters, slots, slot_mass, transposed):
    """d(slots)/dn_i as row i of `slots` (K, V W), and the derivative of the loss into `transposed`."""
    weight, row = encounters.weight, encounters.row
    classes = class_start.size - 1
    met, rows, nothing = np.empty(classes), np.empty(classes, np.int64), np.zeros(0)
    for e in range(weight.shape[0]):
        for a in range(classes):
            for b in range(classes):
                rows[b] = row[e, b * (b + 1) // 2 + a if a <= b else a * (a + 1) // 2 + b]
            for i in range(class_start[a], class_start[a + 1]):
                for b in range(classes):
                    met[b] = 0.0
                    for j in range(class_start[b], class_start[b + 1]):
                        met[b] += weight[e, i, j] * n[j]
                into_mass = slot_mass[i] if slot_mass.shape[0] > 0 else nothing
                _add_products(encounters.products, rows, met, slots[i], into_mass)
                loss, rate = transposed[i], weight[e, i]
                for b in range(classes):
                    loss[i] -= met[b]
                for j in range(n.size):
                    loss[j] -= n[j] * rate[j]


@njit(cache=True)
def _first_order_slopes(first_order, slots, slot_mass, transposed):
    row, nothing = np.empty(1, np.int64), np.zeros(0)
    for i in range(first_order.rate.size):
        row[0] = i
        transposed[i, i] -= first_order.rate[i]
        into_mass = slot_mass[i] if slot_mass.shape[0] > 0 else nothing
        _add_products(first_order.products, row, first_order.rate[i : i + 1], slots[i], into_mass)


@njit(cache=True, fastmath=FAST)
def _restructure_slopes(n, restructuring, transposed):
    start = restructuring.partner_start
    for i in range(restructuring.first_cell.size):
        first = restructuring.first_cell[i]
        last = first + restructuring.shapes[i]
        for g in range(start.size - 1):
            probability = restructuring.transition[g, i]
            seen = 0.0
            for j in range(start[g], start[g + 1]):
                met = n[i] * restructuring.rate[i, j]
                seen += restructuring.rate[i, j] * n[j]
                transposed[j, i] -= met
                after = transposed[j, first:last]
                for s in range(after.size):
                    after[s] += met * probability[s]
            transposed[i, i] -= seen
            after = transposed[i, first:last]
            for s in range(after.size):
                after[s] += seen * probability[s]


@njit(cache=True)
def jacobian_transposed(n, geometry, encounters, first_order, restructuring, averaged):
    """(K + T, K + T) array whose row i is d(dn/dt)/dn_i; exact (with the cell average, off its kinks)."""
    cells, tail = geometry.size_of_cell.size, geometry.tail
    variants = geometry.share.shape[0]
    width = tail + geometry.size_of_cell[-1] + 1
    population = n[:cells]
    slots = np.zeros((cells, variants * width))
    slot_mass = np.zeros((cells if averaged else 0, variants * width))
    transposed = np.zeros((cells + tail, cells + tail))
    _pair_slopes(population, geometry.class_start, encounters, slots, slot_mass, transposed)
    _first_order_slopes(first_order, slots, slot_mass, transposed)
    _restructure_slopes(population, restructuring, transposed)
    nothing = np.zeros(0)
    if not averaged:
        for i in range(cells):
            _births(geometry, slots[i], nothing, transposed[i], nothing)
        return transposed
    # The side of each pivot is frozen at the present births: between its kinks the cell average is linear in them.
    now, now_mass, idle = np.zeros(variants * width), np.zeros(variants * width), np.zeros(cells)
    _pair_rates(population, geometry.class_start, encounters, now, now_mass, idle)
    _first_order_rates(population, first_order, now, now_mass, idle)
    births, birth_mass = np.zeros(cells + tail), np.zeros(cells)
    _births(geometry, now, now_mass, births, birth_mass)
    target = np.empty(cells, np.int64)
    for k in range(cells):
        target[k] = _average_target(geometry, k, births[k], birth_mass[k])
    for i in range(cells):
        number, mass = np.zeros(cells + tail), np.zeros(cells)
        _births(geometry, slots[i], slot_mass[i], number, mass)
        for k in range(cells):
            x, other = geometry.mass[k], target[k]
            if other < 0:
                transposed[i, k] += mass[k] / x
            else:
                moved = (mass[k] - x * number[k]) / (geometry.mass[other] - x)
                transposed[i, k] += number[k] - moved
                transposed[i, other] += moved
        for t in range(cells, number.size):
            transposed[i, t] += number[t]
    return transposed
