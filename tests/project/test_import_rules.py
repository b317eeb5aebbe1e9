"""Who may import whom: the rooms of the tree stay apart."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [*sorted((ROOT / "mcdem").rglob("*.py")), *sorted((ROOT / "pbekit").rglob("*.py"))]


def imported(source: Path) -> set[str]:
    """Every module that a file names in an import, inside functions too."""
    package = source.relative_to(ROOT).parent.parts
    names = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (start, node.module) if part)
            names |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return names


def reaches(source: Path, package: str) -> bool:
    return any(name == package or name.startswith(f"{package}.") for name in imported(source))


def holds_kernels(source: Path) -> bool:
    return "numba" in imported(source) and "njit" in source.read_text()


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: str(source.relative_to(ROOT)))
def test_rooms_stay_apart(source):
    place = source.relative_to(ROOT)
    for outside in ("tests", "validation", "benchmarks", "notebooks"):
        assert not reaches(source, outside), f"{place} imports {outside}, which no package may"
    if place.parts[0] == "pbekit":
        assert not reaches(source, "mcdem"), f"{place} imports mcdem: pbekit stands alone"
    elif reaches(source, "pbekit"):
        assert place == Path("mcdem/kernel_tables.py"), (
            f"{place} imports pbekit: the one crossing is mcdem/kernel_tables.py"
        )
    if holds_kernels(source):
        assert not reaches(source, "xarray"), f"{place} holds kernels and imports xarray"


def test_the_rule_sees_kernels_and_imports_inside_functions():
    assert holds_kernels(ROOT / "mcdem/effects/jkr.py")
    assert reaches(ROOT / "mcdem/commands/run.py", "mcdem.scene")


@pytest.mark.parametrize("argument", ["--help", "describe --help", "run --help"])
def test_help_loads_no_machinery(argument):
    heavy = ["xarray", "matplotlib", "pint", "mcdem.scene", "mcdem.monte_carlo.process"]
    program = (
        "import sys; from mcdem.commands.main import app\n"
        f"try: app({argument.split()!r}, prog_name='mcdem')\n"
        "except SystemExit: pass\n"
        f"print('loaded:', [name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.rstrip().endswith("loaded: []"), done.stdout[-300:]
