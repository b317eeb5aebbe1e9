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

    def spheres(self, centres: ArrayLike, radius: float, colours: ArrayLike, outline: float = 0.35) -> Canvas:
        """Shaded spheres; `outline` darkens their rims so that touching ones stay apart."""
        at = self.camera.project(centres) * self.scale
        r = radius * self.scale
        for (x, y, z), colour in zip(at, np.broadcast_to(np.asarray(colours, float), at.shape), strict=True):
            self._sphere(self.width / 2 + x, self.height / 2 - y, z, r, colour, outline)
        return self

    def _sphere(self, x: float, y: float, z: float, r: float, colour: NDArray, outline: float) -> None:
        left, right = max(int(x - r), 0), min(int(x + r) + 2, self.width)
        top, bottom = max(int(y - r), 0), min(int(y + r) + 2, self.height)
        if left >= right or top >= bottom:
            return
        u = (np.arange(left, right) + 0.5 - x) / r
        v = -(np.arange(top, bottom)[:, None] + 0.5 - y) / r
        inside = 1 - u**2 - v**2
        w = np.sqrt(np.clip(inside, 0.0, None))
        depth = z + r * w
        window = (slice(top, bottom), slice(left, right))
        seen = (inside > 0) & (depth > self.depth[window])
        if not seen.any():
            return
        diffuse = np.clip(u * LIGHT[0] + v * LIGHT[1] + w * LIGHT[2], 0.0, None)
        gloss = np.clip(2 * diffuse * w - LIGHT[2], 0.0, None) ** 24  # mirror direction against the eye's
        rim = 1 - outline * np.exp(-((w / 0.28) ** 2))
        shade = (0.42 + 0.62 * diffuse) * rim
        lit = np.clip(shade[..., None] * colour + 0.35 * gloss[..., None], 0.0, 1.0)
        self.image[window][seen] = lit[seen]
        self.depth[window][seen] = depth[seen]

    def rods(self, starts: ArrayLike, ends: ArrayLike, radius: float, colours: ArrayLike) -> Canvas:
        """Rods with round ends: spheres strung so close that no notch is seen."""
        first, last = np.asarray(starts, float), np.asarray(ends, float)
        tints = np.broadcast_to(np.asarray(colours, float), first.shape)
        for a, b, colour in zip(first, last, tints, strict=True):
            beads = max(2, int(np.linalg.norm(b - a) / (0.35 * radius)))
            self.spheres(a + np.linspace(0, 1, beads)[:, None] * (b - a), radius, colour, outline=0.12)
        return self

    def smoothed(self, by: int = 2) -> Image:
        """The image averaged over `by` x `by` pixels: draw large, show small, no jagged edges."""
        h, w = self.height // by * by, self.width // by * by
        blocks = self.image[:h, :w].reshape(h // by, by, w // by, by, 3)
        return np.asarray(blocks.mean(axis=(1, 3)))


def principal_view(positions: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """(right, up) that show an aggregate broadside: its longest axis to the right, its second one up."""
    centred = positions - positions.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return axes[:, 2], axes[:, 1]
