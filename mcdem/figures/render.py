"""Pictures of spheres: an orthographic view, drawn pixel by pixel with depth and shading.

Colours are (3,) in 0 .. 1, images (height, width, 3). The eye looks along -`toward`; `right` and `up` span the image.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.float64]

LIGHT = np.array([-0.45, 0.55, 0.72]) / np.linalg.norm([-0.45, 0.55, 0.72])
"""Towards the light, in (right, up, toward)."""


@dataclass(frozen=True)
class Camera:
    """What part of space an image shows: `half_width` from `centre` to its left and right edge."""

    centre: ArrayLike
    half_width: float
    right: ArrayLike = (0.0, 0.0, 1.0)
    up: ArrayLike = (0.0, 1.0, 0.0)

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points (N, 3) to (right, up, toward) about the centre. (N, 3)"""
        right, up = np.asarray(self.right, float), np.asarray(self.up, float)
        axes = np.array([right, up, np.cross(right, up)])
        return np.asarray((np.asarray(points, float) - np.asarray(self.centre, float)) @ axes.T)


SHEAR_PLANE = {"right": (0.0, 0.0, 1.0), "up": (0.0, 1.0, 0.0)}
"""Flow to the right, gradient up, vorticity out of the eye's way."""


@dataclass
class Canvas:
    """An image in the making, with the depth of what is seen in each pixel."""

    camera: Camera
    width: int = 400
    height: int = 400
    background: ArrayLike = (1.0, 1.0, 1.0)
    image: Image = field(init=False)
    depth: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        self.image = np.broadcast_to(np.asarray(self.background, float), (self.height, self.width, 3)).copy()
        self.depth = np.full((self.height, self.width), -np.inf)

    @property
    def scale(self) -> float:
        """Pixels per unit of length."""
        return self.width / (2 * self.camera.half_width)

    def spheres(
        self, centres: ArrayLike, radius: ArrayLike, colours: ArrayLike, outline: float = 0.35
    ) -> Canvas:
        """Shaded spheres of one radius or of one each; `outline` darkens their rims so that touching ones stay apart."""
        at = self.camera.project(centres) * self.scale
        radii = np.broadcast_to(np.asarray(radius, float) * self.scale, len(at))
        tints = np.broadcast_to(np.asarray(colours, float), at.shape)
        for (x, y, z), r, colour in zip(at, radii, tints, strict=True):
            self._sphere(self.width / 2 + x, self.height / 2 - y, z, r, colour, outline)
        return self

    def rods(self, starts: ArrayLike, ends: ArrayLike, radius: float, colours: ArrayLike) -> Canvas:
        """Rods with round ends from `starts` (B, 3) to `ends` (B, 3)."""
        first, last = (self.camera.project(x) * self.scale for x in (starts, ends))
        tints = np.broadcast_to(np.asarray(colours, float), first.shape)
        for a, b, colour in zip(first, last, tints, strict=True):
            self._rod(a, b, radius * self.scale, colour)
        return self

    def _window(self, left: float, right: float, top: float, bottom: float) -> tuple[slice, slice]:
        """Rows and columns of the pixels that a box touches; empty outside of the image."""
        rows = slice(max(int(top), 0), max(min(int(bottom) + 2, self.height), 0))
        columns = slice(max(int(left), 0), max(min(int(right) + 2, self.width), 0))
        return rows, columns

    def _sphere(
        self, x: float, y: float, z: float, r: float, colour: NDArray[np.float64], outline: float
    ) -> None:
        window = self._window(x - r, x + r, y - r, y + r)
        u = (np.arange(window[1].start, window[1].stop) + 0.5 - x) / r
        v = -(np.arange(window[0].start, window[0].stop)[:, None] + 0.5 - y) / r
        inside = 1 - u**2 - v**2
        w = np.sqrt(np.clip(inside, 0.0, None))
        self._shade(window, inside > 0, z + r * w, u, v, w, colour, outline)

    def _rod(
        self, a: NDArray[np.float64], b: NDArray[np.float64], r: float, colour: NDArray[np.float64]
    ) -> None:
        x = self.width / 2 + np.array([a[0], b[0]])
        y = self.height / 2 - np.array([a[1], b[1]])
        window = self._window(x.min() - r, x.max() + r, y.min() - r, y.max() + r)
        across = np.arange(window[1].start, window[1].stop) + 0.5 - x[0]
        down = np.arange(window[0].start, window[0].stop)[:, None] + 0.5 - y[0]
        dx, dy = x[1] - x[0], y[1] - y[0]
        along = np.clip((across * dx + down * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
        u, v = (across - along * dx) / r, -(down - along * dy) / r
        inside = 1 - u**2 - v**2
        w = np.sqrt(np.clip(inside, 0.0, None))
        self._shade(window, inside > 0, a[2] + along * (b[2] - a[2]) + r * w, u, v, w, colour, 0.25)

    def _shade(
        self,
        window: tuple[slice, slice],
        inside: NDArray[np.bool_],
        depth: NDArray[np.float64],
        u: NDArray[np.float64],
        v: NDArray[np.float64],
        w: NDArray[np.float64],
        colour: NDArray[np.float64],
        outline: float,
    ) -> None:
        """Colour the pixels of a window where a surface of unit normal (u, v, w) is nearer than what is there."""
        seen = inside & (depth > self.depth[window])
        if not seen.any():
            return
        diffuse = np.clip(u * LIGHT[0] + v * LIGHT[1] + w * LIGHT[2], 0.0, None)
        gloss = np.clip(2 * diffuse * w - LIGHT[2], 0.0, None) ** 24  # mirror direction against the eye's
        rim = 1 - outline * np.exp(-((w / 0.28) ** 2))
        shade = (0.42 + 0.62 * diffuse) * rim
        lit = np.clip(shade[..., None] * colour + 0.35 * gloss[..., None], 0.0, 1.0)
        self.image[window][seen] = lit[seen]
        self.depth[window][seen] = depth[seen]

    def smoothed(self, by: int = 2) -> Image:
        """The image averaged over `by` x `by` pixels: draw large, show small, no jagged edges."""
        h, w = self.height // by * by, self.width // by * by
        shifts = [self.image[i:h:by, j:w:by] for i in range(by) for j in range(by)]
        return np.asarray(sum(shifts) / by**2)


def principal_view(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(right, up) that show an aggregate broadside: its longest axis to the right, its second one up."""
    centred = positions - positions.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return axes[:, 2], axes[:, 1]
