"""Errors that are the user's to mend: each message names the place, what stands there and the cure.

The command line prints them on one line and exits with code 2; everything else is a defect of the program and
keeps its traceback.
"""

from __future__ import annotations


class UserError(Exception):
    """Something the user gave cannot be used.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.aggregates import straight_chain
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> try:
    ...     straight_chain(scene, 0)
    ... except mcdem.UserError as error:
    ...     print(error)
    expected 1 to 1000 primaries
    """


class SceneError(UserError):
    """A scene (its file, a table, a key or a value) cannot be used.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> try:
    ...     scene.with_changes({"suspension.radius": "500 Pa"})
    ... except mcdem.SceneError as error:
    ...     print(str(error).partition(";")[0])
    scenes/paper-1000Pa.toml: [suspension] radius = "500 Pa" has the wrong dimension (Pa)
    """


class DataFileError(UserError):
    """A dataset cannot be read, is not ours, or would be overwritten.

    Examples
    --------
    >>> import mcdem
    >>> try:
    ...     mcdem.open_run("scenes/paper-1000Pa.toml")
    ... except mcdem.DataFileError as error:
    ...     print(error)
    scenes/paper-1000Pa.toml: cannot be read as NetCDF (Unknown file format); expected a dataset written by `mcdem run`
    """


class MachineWarning(UserWarning):
    """Encounters of one dataset are computed on machines that round differently."""
