"""What the balance cannot mean is refused in one line that says what was expected, by its functions and by its command."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
from pbe_synthetic import RADIUS, SHEAR_RATE, encounters
from typer.testing import CliRunner

from pbekit import (
    Aggregation,
    Breakage,
    CollisionalBreakup,
    Grid,
    PBEError,
    PopulationBalance,
    Restructuring,
    TwoComponentGrid,
    compare_table,
    integrate,
    open_table,
    steady_state,
    stress_law,
)
from pbekit.balance.breakage import BetaSplit, CriticalSize, PowerLawRate, SchulzZimm, TwoPeak, Uniform
from pbekit.balance.efficiencies import VanDeVenMason
from pbekit.balance.encounters import PairRows
from pbekit.balance.kernels import FractalRadius, ShearEncounter
from pbekit.commands.main import app
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.estimated_rates.stress_interpolation import common_grid, interpolate
from pbekit.solution.finite_population import population_course
from pbekit.study.solve_table import solve_table
from pbekit.study.uncertainty import band, draws_of
from pbekit.tables.kernel_table import KernelTable

GRID = Grid.primaries(10)
OPEN = PopulationBalance(GRID, [Aggregation(1.0)])
CLOSED = PopulationBalance(GRID, [Aggregation(1.0)], edge="closed")
START = GRID.monodisperse(1.0)
TIMES = np.linspace(0.0, 1.0, 3)
SHAPED = GRID.with_shapes([1, 2, 3])


def table(largest: int, **about) -> KernelTable:
    rng = np.random.default_rng(1)
    size = rng.integers(1, largest + 1, (300, 2))
    return KernelTable.of(encounters(rng, size, np.ones((300, 2))), RADIUS, SHEAR_RATE, shapes=1, about=about)


TABLE = table(7)
RATES = EstimatedRates(TABLE, GRID)
NARROW, WIDER = table(7, viscosity=1.0), table(11, viscosity=2.0)


def with_kernel(kernel):
    return lambda: PopulationBalance(GRID, [Aggregation(kernel)])


def breaking(rate, daughters=None):
    return lambda: PopulationBalance(GRID, [Breakage(rate, daughters or Uniform())])


def falls(mass):
    return np.where(mass > 1, 1.0, 0.0)


def per_pair(daughters):
    return lambda: PopulationBalance(GRID, [CollisionalBreakup(1.0, daughters)])


REFUSED = {
    "kernel of text": (with_kernel("fast"), "kernel: got 'fast', expected a Kernel"),
    "kernel of one row": (with_kernel([1.0, 2.0]), r"kernel: got .*an array \(K, K\)"),
    "kernel in three dimensions": (with_kernel(np.ones((10, 10, 2))), r"kernel: got .*an array \(K, K\)"),
    "kernel of another grid": (with_kernel(np.ones((3, 3))), r"array is \(3, 3\), but the grid has 10 cells"),
    "kernel of nothing": (with_kernel(None), "kernel: got None"),
    "kernel true": (with_kernel(True), "kernel: got True"),
    "kernel that returns another shape": (with_kernel(lambda a, b: np.ones(7)), r"numbers that broadcast to \(10, 10\)"),
    "kernel that returns text": (with_kernel(lambda a, b: "x"), r"numbers that broadcast to \(10, 10\)"),
    "kernel of one argument": (with_kernel(lambda a: a), "takes 1 arguments, expected"),
    "shear of text": (lambda: ShearEncounter("x"), "shear_rate = 'x': expected a number above 0"),
    "radius below zero": (lambda: FractalRadius(-1.0), "radius = -1.0: expected a number above 0"),
    "attraction of nan": (lambda: VanDeVenMason(float("nan")), "attraction = nan: expected a number above 0"),
    "rate of text": (breaking("x"), "breakage rate str: expected a number"),
    "rate of another grid": (breaking([0.0, 1.0]), r"expected a number, a function of mass, or an array \(10,\)"),
    "rate that returns another shape": (breaking(lambda m: np.ones(3)), r"or an array \(10,\)"),
    "law of a rate of text": (lambda: PowerLawRate("x"), "PowerLawRate: rate = 'x'"),
    "critical size below zero": (lambda: CriticalSize(-1.0, 1.0, 1.0), "CriticalSize: stress = -1.0"),
    "daughters of number": (breaking(falls, 3), "daughters: expected a Daughters"),
    "daughters that return a number": (breaking(falls, lambda p: 3), "expected two arrays of one length"),
    "daughters of two lengths": (breaking(falls, lambda p: ([1, 2], [1])), "expected two arrays of one length"),
    "beta below zero": (lambda: BetaSplit(-1.0), "BetaSplit: concentration = -1.0"),
    "two peaks of text": (lambda: TwoPeak("x"), "TwoPeak: fraction = 'x'"),
    "gamma of no mean": (lambda: SchulzZimm(0.0), "SchulzZimm: mean = 0.0"),
    "pairs that break into one array": (per_pair(lambda a, b: (3,)), "expected two arrays, masses and expected numbers"),
    "pairs that break into two lengths": (per_pair(lambda a, b: ([1, a], [1])), "2 masses and 1 numbers"),
    "pair rows of another shape": (per_pair(PairRows(np.ones((2, 2)))), "pair rows"),
    "pair rows of text": (per_pair(PairRows("x")), "products of pair rows: cannot be read"),
    "transition of text": (lambda: PopulationBalance(SHAPED, [Restructuring(1.0, "x")]), "transition: cannot be read"),
    "shapes of text": (lambda: PopulationBalance(SHAPED, [Aggregation(1.0, "x")]), "shape shares: cannot be read"),
    "a number as an event": (lambda: PopulationBalance(GRID, [3]), "events: got 3"),
    "a number as a grid": (lambda: PopulationBalance(3, [Aggregation(1.0)]), "grid: got 3, expected a Grid"),
    "grid of text": (lambda: Grid("x", [1.0], True), "pivots: cannot be read as numbers"),
    "grid of half a size": (lambda: Grid.primaries(2.5), "exact_to = 2.5: expected a whole number"),
    "grid of too many": (lambda: Grid.primaries(10**9), "exact_to = 1000000000: expected a whole number from 1 to"),
    "grid that ends too early": (lambda: Grid.primaries(32, largest=5), "largest = 5 lies below exact_to = 32"),
    "grid without growth": (lambda: Grid.primaries(5, largest=50, ratio=1.0), "ratio = 1.0"),
    "volumes from zero": (lambda: Grid.geometric(0.0, 1.0), "smallest = 0.0"),
    "volumes backwards": (lambda: Grid.geometric(2.0, 1.0), "largest = 1.0: expected a number from 2"),
    "radii of text": (lambda: GRID.with_outer_radius("x"), "outer radii: cannot be read"),
    "radii of another grid": (lambda: GRID.with_outer_radius([1.0, 2.0]), r"outer radii: got shape \(2,\)"),
    "radii of three arguments": (lambda: GRID.with_outer_radius(lambda a, b, c: a), "a function of 3 arguments"),
    "shapes edges of text": (lambda: GRID.with_shapes("x"), "shape edges: cannot be read"),
    "two components of text": (lambda: TwoComponentGrid("x", [1, 2]), "first pivots: cannot be read"),
    "number below zero": (lambda: GRID.monodisperse(-1.0), "number = -1.0"),
    "number of text": (lambda: GRID.monodisperse("x"), "number = 'x'"),
    "population of text": (lambda: integrate(OPEN, "x", TIMES), r"population: expected \(10,\) numbers"),
    "population of another grid": (lambda: integrate(OPEN, START[:3], TIMES), r"population: got shape \(3,\)"),
    "times of text": (lambda: integrate(OPEN, START, "x"), "times: cannot be read"),
    "times without end": (lambda: integrate(OPEN, START, [0.0, np.inf]), "times: times must be finite"),
    "Euler": (lambda: integrate(OPEN, START, TIMES, method="Euler"), "method = 'Euler': expected one of LSODA, BDF"),
    "a number as a method": (lambda: integrate(OPEN, START, TIMES, method=3), "method = 3"),
    "tolerance below zero": (lambda: integrate(OPEN, START, TIMES, rtol=-1.0), "rtol = -1.0"),
    "a number as a balance": (lambda: integrate(3, START, TIMES), "balance: got 3, expected a PopulationBalance"),
    "steady state of nothing": (lambda: steady_state(CLOSED, 0.0 * START), "the population is empty"),
    "steady guess of text": (lambda: steady_state(CLOSED, START, guess="x"), "guess: cannot be read"),
    "steady tolerance": (lambda: steady_state(CLOSED, START, tolerance=-1.0), "tolerance = -1.0"),
    "largest below what was seen": (lambda: grid_for(TABLE, largest=5), "largest = 5: expected at least 7, the largest"),
    "shapes by a word": (lambda: grid_for(TABLE, shapes="round"), 'shapes: got \'round\', expected "table"'),
    "grid for a path": (lambda: grid_for("kernels.nc"), "table: got 'kernels.nc', expected a KernelTable"),
    "fraction below zero": (lambda: start_of(GRID, TABLE, -1.0), "volume fraction = -1.0: expected a share"),
    "fraction beyond a packing": (lambda: start_of(GRID, TABLE, 0.8), "volume fraction = 0.8"),
    "estimated of a path": (lambda: EstimatedRates("kernels.nc", GRID), "table: got 'kernels.nc'"),
    "estimated without a grid": (lambda: EstimatedRates(TABLE, "x"), "grid: got 'x', expected a Grid"),
    "estimated of an edge": (lambda: EstimatedRates(TABLE, GRID, edge="x"), "edge: got 'x', expected one of"),
    "stress of text": (lambda: interpolate([TABLE, TABLE], "x"), "stress = 'x'"),
    "stress of nan": (lambda: interpolate([TABLE, TABLE], float("nan")), "stress = nan"),
    "no draws": (lambda: draws_of(EstimatedRates(TABLE, GRID), dict, 0), "draws = 0"),
    "a negative seed": (lambda: draws_of(EstimatedRates(TABLE, GRID), dict, 2, seed=-1), "seed = -1"),
    "level beyond one": (lambda: band(np.ones(3), 2.0), "level = 2.0"),
    "too few draws over stresses": (lambda: stress_law([TABLE, TABLE], 18), "draws = 18: expected 19 to 1000000"),
    "too few draws beside a run": (lambda: compare_table(TABLE, None, 18), "draws = 18: expected 19 to 1000000"),
    "comparison until never": (lambda: compare_table(TABLE, None, until=np.inf), "until = inf: expected a time above 0"),
    "solving a number": (lambda: solve_table(3), "table: got 3, expected a KernelTable, its file, or several"),
    "opening a number": (lambda: open_table(3), "table: got 3, expected the file of one"),
    "solving several numbers": (lambda: solve_table([3, 4]), "table: got 3, expected the file of one"),
    "solving nothing": (lambda: solve_table([]), r"table: got \[\], expected a KernelTable"),
    "a time of another unit": (lambda: solve_table(TABLE, until="3 furlongs"), 'expected a time such as "10 s"'),
    "solving until never": (lambda: solve_table(TABLE, until=np.nan), "until = nan: expected a time above 0"),
    "solving with Euler": (lambda: solve_table(TABLE, method="Euler"), "method = 'Euler': expected one of LSODA"),
    "solving by a scheme": (lambda: solve_table(TABLE, scheme="best"), "scheme = 'best': expected one of fixed pivot"),
    "solving with one draw": (lambda: solve_table(TABLE, draws=1), r"draws = 1: expected 0 \(no bands\) or 19"),
    "solving with a negative seed": (lambda: solve_table(TABLE, seed=-1), "seed = -1: expected a whole number"),
    "solving with half a sample": (lambda: solve_table(TABLE, samples=2.5), "samples = 2.5: expected a whole number"),
    "solving with what is no option": (lambda: solve_table(TABLE, step=1), "step: no option of solve_table, expected one of"),
    "largest below what one of two saw": (lambda: common_grid([NARROW, WIDER], largest=8), "largest = 8: expected at least 11"),
    "finite population of no fraction": (lambda: population_course(RATES, 0.0, TIMES), "volume fraction = 0.0"),
    "finite population backwards": (lambda: population_course(RATES, 1e-4, [1.0, 0.0]), "times must be 0 or more"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_line(name):
    call, words = REFUSED[name]
    with pytest.raises(PBEError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_a_number_of_numpy_and_one_event_are_taken():
    for kernel in (np.float64(1.0), np.int64(1), 1):
        one = PopulationBalance(GRID, Aggregation(kernel))
        np.testing.assert_array_equal(one.rhs(0.0, one.state(START)), OPEN.rhs(0.0, OPEN.state(START)))


def test_public_names_are_what_they_say_whatever_files_are_called():
    """`solve_table` and `efficiencies` are functions, and files, too; names come when they are first used."""
    program = (
        "import sys, pbekit\n"
        "assert not {'numpy', 'xarray'} & set(sys.modules)\n"
        "import pbekit.commands.main, pbekit.balance.efficiencies, pbekit.study.solve_table, pbekit.study.report\n"
        "print([name for name in pbekit.__all__ if not callable(getattr(pbekit, name))])\n"
        "print(pbekit.compare_table.__module__)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\npbekit.study.compare\n"


def test_a_largest_size_is_the_grids():
    for largest in (7, 12, 40):
        assert grid_for(TABLE, largest=largest).pivots[-1] >= largest
    assert grid_for(TABLE, largest=7).pivots[-1] == 7 and grid_for(TABLE).pivots[-1] == 32


@pytest.fixture(scope="module")
def kernels(tmp_path_factory):
    path = tmp_path_factory.mktemp("tables") / "kernels.nc"
    TABLE.save(path)
    return path


OPTIONS = {
    "--method Euler": "--method 'Euler': expected one of LSODA, BDF, Radau",
    "--scheme best": "--scheme 'best': expected one of fixed pivot, cell average, three pivots",
    "--volume-fraction -1": "--volume-fraction -1.0: expected a share of the volume from 1e-15 to 0.74",
    "--volume-fraction 0.8": "--volume-fraction 0.8: expected a share of the volume",
    "--volume-fraction nan": "--volume-fraction nan: expected a share of the volume",
    "--largest 5": "largest = 5: expected at least 7, the largest aggregate that the table saw",
    "--stress -3": "--stress -3.0: expected a shear stress in Pa from 1e-12 to 1e+12",
    "--stress inf": "--stress inf: expected a shear stress",
    "--seed 99999999999999999999": "--seed",
    "--exact-to 1000000": "--exact-to",
    "--draws -1": "--draws",
    "--draws 18": "--draws 18: expected 0 (no bands) or 19 to 1000000; 19 are the fewest",
    "--samples 1": "--samples",
}


@pytest.mark.parametrize("option", OPTIONS)
def test_options_that_cannot_be_meant_are_refused(option, kernels, tmp_path):
    out = tmp_path / "out.nc"
    done = CliRunner().invoke(app, ["solve", str(kernels), "-o", str(out), *option.split()])
    assert done.exit_code == 2, done.output
    assert (
        OPTIONS[option] in " ".join(done.output.replace("│", " ").split()) and "Traceback" not in done.output
    )
    assert not out.exists()


@pytest.mark.parametrize("place", ["taken", "taken/below"])
@pytest.mark.parametrize("command", ["compare", "stresses"])
def test_a_file_where_a_folder_is_asked_for_is_refused_in_a_line(command, place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.nc", "b.nc"):
        table(7, viscosity=1.0, volume_fraction=1e-4).save(tmp_path / name)
    (tmp_path / "taken").write_text("mine")
    done = CliRunner().invoke(app, [command, "a.nc", "b.nc", "-o", place])
    assert done.exit_code == 2, done.output
    assert done.output.startswith(f"error: {place}: cannot be made a folder") and done.output.count("\n") == 1
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize("command", ["compare", "stresses"])
def test_the_least_draws_of_a_command_are_those_of_a_band(command, kernels, tmp_path):
    done = CliRunner().invoke(app, [command, str(kernels), "-o", str(tmp_path / "out"), "--draws", "18"])
    assert done.exit_code == 2 and "greater than or equal to 19" in done.output
    assert not (tmp_path / "out").exists()


def test_what_is_not_taken_as_given_is_said(kernels, tmp_path):
    given = ["solve", str(kernels), "-o", str(tmp_path / "out.nc"), "--until", "1", "--samples", "2"]
    done = CliRunner().invoke(app, [*given, "--volume-fraction", "0.3", "--largest", "14"])
    assert done.exit_code == 0, done.output
    assert "warning: at a volume fraction of 0.3 encounters are not of two aggregates alone" in done.output
    assert "exact_to = 32 is taken as 14, the largest size" in done.output
    dilute = CliRunner().invoke(app, [*given, "--volume-fraction", "1e-4", "--overwrite"])
    assert dilute.exit_code == 0 and "warning" not in dilute.output
    shutil.rmtree(tmp_path)
