"""What a figure is here: numbers, and a drawing of nothing but these numbers.

Both are saved side by side, ``NAME.png`` and ``NAME.nc``, so that any figure can be drawn again, or otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.errors import UserError
from mcdem.figures.style import look
from mcdem.netcdf.whole_files import FILES

Draw = Callable[[xr.Dataset], Canvas]


class NothingToShowError(UserError):
    """Why a figure is left out: an empty one would say that there is nothing, not that nothing was seen.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import NothingToShowError, critical_size
    >>> try:
    ...     critical_size([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    ... except NothingToShowError as why:
    ...     print(why)
    fig15_critical_size: needs runs at two or more stresses, there is one
    """


@dataclass(frozen=True)
class Figure:
    """A figure to be: its file name, its caption, its numbers and what draws them.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.figures import pair_force
    >>> figure = pair_force(mcdem.load_scene("scenes/paper-1000Pa.toml"))
    >>> figure.named("forces").name
    'forces'
    """

    name: str
    caption: str
    numbers: xr.Dataset
    draw: Draw

    def named(self, name: str) -> Figure:
        """The same figure under another file name."""
        return replace(self, name=name)

    def save(self, directory: Path) -> Path:
        """Write ``NAME.png`` and ``NAME.nc`` into the directory; returns the picture's path."""
        picture = directory / f"{self.name}.png"
        with look():
            FILES.write_picture(picture, self.draw(self.numbers))
        FILES.write_numbers(directory / f"{self.name}.nc", self.numbers.assign_attrs(caption=self.caption))
        return picture


def quantity(values: object, dim: str | tuple[str, ...], units: str, long_name: str) -> xr.Variable:
    """A variable with its units and its name in words."""
    return xr.Variable(dim, values, {"units": units, "long_name": long_name})
