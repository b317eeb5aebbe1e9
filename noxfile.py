"""The tests under every Python that is supported, with the newest and the oldest dependencies: `nox`, or `nox -s tests-3.12`.

A Python that is not installed is skipped, and said to be.  `nox -s oldest` takes the lower bounds of `pyproject.toml`.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import nox

PYTHONS = ["3.11", "3.12", "3.13", "3.14"]
PROJECT = tomllib.loads((Path(__file__).parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TESTS = ("python", "-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile")

nox.options.sessions = ["tests"]
nox.options.error_on_missing_interpreters = False


def lower_bounds() -> list[str]:
    """The dependencies, each at the lowest version that is declared."""
    return [re.sub(r">=", "==", line) for line in PROJECT["dependencies"] if ">=" in line]


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """The suite with the newest dependencies."""
    session.install(".[dev]")
    session.run(*TESTS, *session.posargs)


@nox.session(python=PYTHONS[0])
def oldest(session: nox.Session) -> None:
    """The suite with the oldest dependencies, on the oldest Python."""
    session.install(".[dev]", *lower_bounds())
    session.run(*TESTS, *session.posargs)


@nox.session(python=PYTHONS[0])
def docs(session: nox.Session) -> None:
    """The manual, strictly."""
    session.install(".[docs]")
    session.run("python", "-m", "docs", *session.posargs)
