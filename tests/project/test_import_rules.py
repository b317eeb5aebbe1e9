"""Who may import whom: the packages of the tree stay apart."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHARED = ("pbekit.endings", "pbekit.program", "pbekit.progress", "pbekit.version")
"""What a command line program answers and shows, how it ends, and the version, are the same for both."""
CROSSINGS = {
    **dict.fromkeys(
        (f"mcdem/kernel_tables/{path.name}" for path in (ROOT / "mcdem/kernel_tables").glob("*.py")),
        ("pbekit",),
    ),
    "mcdem/netcdf/whole_files.py": ("pbekit.checksum", "pbekit.files"),
}
"""What else is taken from pbekit, and where: the balance of a table, and the one way to files."""
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
    return bool(
        {"numba.njit", "mcdem.compilation.compiled", "mcdem.compilation.separately_compiled"}
        & imported(source)
    )


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: str(source.relative_to(ROOT)))
def test_packages_stay_apart(source):
    place = source.relative_to(ROOT)
    for outside in ("tests", "validation", "benchmarks", "notebooks"):
        assert not reaches(source, outside), f"{place} imports {outside}, which no package may"
    if place.parts[0] == "pbekit":
        assert not reaches(source, "mcdem"), f"{place} imports mcdem: pbekit stands alone"
    else:
        allowed = (*SHARED, *CROSSINGS.get(str(place), ()))
        for name in imported(source) - {"pbekit"}:  # of `from pbekit import endings`
            taken = name.split(".")[0] == "pbekit"
            within = any(name == own or name.startswith(f"{own}.") for own in allowed)
            assert not taken or within, (
                f"{place} imports {name}: it may import {', '.join(allowed)} of pbekit"
            )
    if holds_kernels(source):
        assert not reaches(source, "xarray"), f"{place} holds kernels and imports xarray"


WRITES = {"write_text", "write_bytes", "to_netcdf", "to_csv", "savefig", "savetxt", "tofile"}
READS = {"open_dataset", "load_dataset", "open_datatree"}
NOT_FILES_OF_USERS = {"beside", "buffer"}
"""Names of what is written beside a place (`Files.replacing`), or kept in memory."""


def strays(tree: ast.AST) -> list[str]:
    """Calls that write or read a file by another way than that of `pbekit.files`."""
    guarded = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.With)
        and any(".reading(" in ast.unparse(item.context_expr) for item in node.items)
        for inner in ast.walk(node)
    }
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
            continue
        name = node.func.attr
        about = {n.id for part in (node.func, *node.args) for n in ast.walk(part) if isinstance(n, ast.Name)}
        opens = name == "open" and any(
            isinstance(a, ast.Constant) and str(a.value)[:1] in "wax" for a in node.args
        )
        if (name in WRITES or opens) and not about & NOT_FILES_OF_USERS:
            found.append(ast.unparse(node))
        if name in READS and id(node) not in guarded:
            found.append(ast.unparse(node))
    return found


def test_files_are_written_and_read_in_one_way():
    found = {str(source.relative_to(ROOT)): strays(ast.parse(source.read_text())) for source in SOURCES}
    assert {place for place, calls in found.items() if calls} <= {"pbekit/files.py", "pbekit/checksum.py"}, (
        found
    )


def test_the_rule_sees_other_ways():
    for words in ("path.write_text('x')", "data.to_netcdf(path)", "path.open('w')", "xr.open_dataset(path)"):
        assert strays(ast.parse(words)) == [words]
    assert not strays(ast.parse("with FILES.reading(path, ''), xr.open_dataset(path) as data: pass"))


def test_the_way_to_files_knows_neither_program():
    for source in ("pbekit/files.py", "pbekit/checksum.py"):
        ours = {name for name in imported(ROOT / source) if name.split(".")[0] in ("mcdem", "pbekit")}
        assert all(name.startswith(("pbekit.checksum", "pbekit.version")) for name in ours)


def test_the_rule_sees_kernels_and_imports_inside_functions():
    assert holds_kernels(ROOT / "mcdem/effects/jkr.py")
    assert reaches(ROOT / "mcdem/commands/run.py", "mcdem.scene")


@pytest.mark.parametrize("argument", ["--help", "describe --help", "run --help"])
def test_help_loads_no_machinery(argument):
    heavy = ["numpy", "xarray", "matplotlib", "pint", "mcdem.scene", "mcdem.monte_carlo.run_control"]
    assert loaded_by(argument, heavy) == "[]"


@pytest.mark.parametrize("argument", ["check scenes/quickstart.toml", "describe"])
def test_what_is_read_of_a_scene_takes_no_machinery(argument):
    """Text with units is read without pint, and the laws of contacts are asked without making numba ready to compile."""
    assert loaded_by(argument, ["xarray", "matplotlib", "pint", "numba.cpython.listobj"]) == "[]"


def loaded_by(arguments, modules):
    """Which of the modules a subcommand loads, as a list is printed."""
    program = (
        "import sys; from mcdem.commands.main import app\n"
        f"try: app({arguments.split()!r}, prog_name='mcdem')\n"
        "except SystemExit: pass\n"
        f"print('loaded:', [name for name in {modules!r} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return done.stdout.rstrip().rpartition("loaded: ")[2]
