"""Rates to read, short forms and hand-over: known rates are recovered, and independent solvers come to the balance's answer."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from pbe_synthetic import RADIUS, SHEAR_RATE, design, known_balance, outer_radius, probabilities
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from pbekit import Aggregation, KernelTable, PBEError, PopulationBalance, integrate
from pbekit.commands.main import app
from pbekit.export import TARGETS, export_table, hand_over
from pbekit.study.fitted_laws import fitted_laws
from pbekit.study.outcome_laws import LEAST
from pbekit.study.size_rates import Limits, size_rates
from pbekit.tables.kernel_table import AGGREGATION, MISSED

LARGEST = 12
PHI = 0.01 * 4 / 3 * np.pi * RADIUS**3
UNTIL = 200.0


def synthetic(seed: int, count: int, **about) -> KernelTable:
    records = design(np.random.default_rng(seed), count, LARGEST, pieces=3)
    known = {"volume_fraction": PHI, "viscosity": 1e-3, "scene_name": "synthetic", **about}
    return KernelTable.of(
        records, RADIUS, SHEAR_RATE, size_edges=np.arange(1, LARGEST + 2), shapes=1, about=known
    )


@pytest.fixture(scope="module")
def given():
    return hand_over(synthetic(1, 8000), draws=19, until=UNTIL, exact_to=LARGEST, largest=LARGEST)


@pytest.fixture(scope="module")
def without_breakup():
    table = synthetic(2, 3000)
    records = table.records.select(np.isin(table.records.outcome, (MISSED, AGGREGATION)))
    return hand_over(table.with_records(records), draws=19, until=5.0, exact_to=LARGEST, largest=4 * LARGEST)


def rows(path):
    with path.open() as file:
        names, *values = csv.reader(file)
    return dict(zip(names, np.array(values, float).T, strict=True))


# -- rates --------------------------------------------------------------------------------------------------------


def test_limits_cover_the_known_rates_as_often_as_they_say():
    """90 % limits of K_ij, of S_i and of the daughters over 12 tables of 4000 encounters.

    K: 78 pairs a table, 936 in all, of which 0.9 +- 0.01 are covered; S and daughters are averages over the same
    encounters, so that a table counts as one or two: 0.9 +- 0.06.  (Over 48 tables: 0.92, 0.94 and 0.89.)
    """
    _, start = known_balance(LARGEST)
    i, j = np.tril_indices(LARGEST)
    p = np.arange(1.0, LARGEST + 1)
    join, scatter = probabilities(p[:, None], p[None])
    rate = 4 / 3 * SHEAR_RATE * (outer_radius(p)[:, None] + outer_radius(p)[None]) ** 3
    n = np.exp(-p / 4)
    n *= start[0] / (n @ p)
    inside = {"K": [], "S": [], "daughters": []}
    for seed in range(12):
        found = size_rates(
            synthetic(100 + seed, 4000), draws=39, exact_to=LARGEST, largest=LARGEST, population=n
        )
        K, S = found.aggregation_rate, found.first_order.breakage
        known = (rate * join)[i, j]
        inside["K"].append(np.mean((K.low[i, j] <= known) & (known <= K.high[i, j])))
        products = np.zeros((LARGEST, LARGEST, LARGEST))
        products[i, j] = products[j, i] = _three_pieces(i + j + 2)
        bonds = p - 1
        share = bonds[:, None] / np.maximum(bonds[:, None] + bonds[None], 1)
        more = np.maximum(products.sum(axis=2) - 2, 0.0)
        first_order = (rate * scatter * share * more) @ n
        inside["S"].append(np.mean(((S.low <= first_order) & (first_order <= S.high))[1:]))
        error = np.abs(found.daughters - products)
        seen = found.daughters_error > 1e-3
        inside["daughters"].append(np.mean(error[seen] <= 1.645 * found.daughters_error[seen]))
    print({name: (np.mean(share), np.std(share)) for name, share in inside.items()})
    assert 0.87 <= np.mean(inside["K"]) <= 0.94
    assert 0.78 <= np.mean(inside["S"]) <= 0.99
    assert 0.78 <= np.mean(inside["daughters"]) <= 0.99


def _three_pieces(total):
    """(pairs, LARGEST) products on the grid of `pbe_synthetic`, closed at its end."""
    row = []
    for m in total:
        size = np.arange(1, m)
        number = 6 * (m - 1 - size) / max((m - 1) * (m - 2), 1) if m > 2 else np.array([2.0])
        on = np.zeros(LARGEST)
        for s, k in zip(size, number, strict=True):
            on[min(s, LARGEST) - 1] += k * max(1.0, s / LARGEST)
        row.append(on)
    return np.array(row)


def test_first_order_rates_go_with_the_volume_fraction():
    table, n = synthetic(1, 2000), np.arange(LARGEST, 0.0, -1)
    one, two = (
        size_rates(table, draws=19, exact_to=LARGEST, largest=LARGEST, volume_fraction=phi, population=n)
        for phi in (1e-4, 3e-4)
    )
    np.testing.assert_allclose(two.first_order.breakage.value, 3 * one.first_order.breakage.value, rtol=1e-12)


# -- short forms --------------------------------------------------------------------------------------------------


def test_a_form_that_holds_is_found_and_refuses_outside_its_range(given):
    law = given.laws.radius
    assert law.coefficient("d") == pytest.approx(2.0, rel=1e-3) and law.coefficient("k") == pytest.approx(
        1, rel=1e-3
    )
    assert law.residual < 1e-3
    for refused in (
        lambda: law(LARGEST + 1),
        lambda: given.laws.efficiency(1, 2 * LARGEST),
        lambda: given.laws.breakage(10 * LARGEST, 1e-4, 1.0),
        lambda: given.laws.daughters(1.5),
    ):
        with pytest.raises(PBEError, match="beyond it nothing is known"):
            refused()


def test_residuals_are_those_of_the_forms(given):
    laws, rates = given.laws, given.rates
    low, high = laws.breakage.validity["P"]
    used = (rates.pivots >= low) & (rates.pivots <= high)
    fit = laws.breakage(rates.pivots[used], PHI, SHEAR_RATE)
    apart = np.abs(fit / rates.first_order.breakage.value[used] - 1)
    assert apart.max() <= laws.breakage.residual * (1 + 1e-9) or apart.max() == pytest.approx(
        laws.breakage.residual
    )
    i, j = np.tril_indices(LARGEST)
    join, _ = probabilities(i + 1.0, j + 1.0)
    counted = rates.aggregated[i, j] >= LEAST
    # The truth lies within the residual and three standard deviations of the fewest counts that are judged.
    assert (
        np.abs(laws.efficiency(i + 1, j + 1) / join - 1)[counted].max()
        < laws.efficiency.residual + 3 / LEAST**0.5
    )
    x = np.linspace(0.01, 0.99, 99)
    assert np.trapezoid(laws.daughters(x), x) == pytest.approx(1, abs=0.02)
    assert laws.daughters.residual < 0.05
    # Three pieces, whatever the pair; the peaks were fitted to masses alone.
    assert laws.daughters.constants["mean_number_of_the_law"] == pytest.approx(3, rel=0.05)


def stepped(rates, k, q, s, critical, m):
    """The same rates with another S, of a known step, and a population that holds all sizes alike."""
    p = rates.pivots
    value = PHI * SHEAR_RATE * k * p**q * (s + 1 / (1 + (critical / p) ** m))
    first = dataclasses.replace(
        rates.first_order,
        breakage=Limits(value, value, value),
        population=1 / (p * np.maximum(value, 1e-300)),
    )
    return dataclasses.replace(rates, first_order=first)


def test_a_step_is_found_where_breakage_is_one(given):
    """Its coefficients, a residual of round-off where the power misses several times over, and the choice between them."""
    known = {"k": 0.3, "q": 1.0, "s": 2e-3, "P_0": 6.0, "m": 12.0}
    laws = fitted_laws(stepped(given.rates, *known.values()))
    for name, value in known.items():
        assert laws.breakage_step.coefficient(name) == pytest.approx(value, rel=1e-3), name
    assert laws.breakage_step.residual < 1e-4 < 0.5 < laws.breakage.residual
    assert laws.best_breakage is laws.breakage_step
    assert laws.breakage_step.critical_size() == pytest.approx(6.0, rel=1e-3)
    low, high = laws.breakage_step.validity["P"]
    p = np.arange(low, high + 1)
    wanted = PHI * SHEAR_RATE * 0.3 * p * (2e-3 + 1 / (1 + (6.0 / p) ** 12))
    np.testing.assert_allclose(laws.breakage_step(p, PHI, SHEAR_RATE), wanted, rtol=1e-4)
    with pytest.raises(PBEError, match="beyond it nothing is known"):
        laws.breakage_step(2 * LARGEST, PHI, SHEAR_RATE)
    assert fit_record(laws)["breakage_step"]["largest_residual"] == laws.breakage_step.residual


def test_a_power_is_kept_where_breakage_is_one(given):
    """A power that is scattered by 5 % is no step: three more coefficients do not pay."""
    rates, scatter = given.rates, np.random.default_rng(1).normal(0, 0.05, given.rates.pivots.size)
    p = rates.pivots
    value = PHI * SHEAR_RATE * 0.01 * p**2.5 * np.exp(scatter)
    first = dataclasses.replace(
        rates.first_order, breakage=Limits(value, value, value), population=1 / (p * value)
    )
    laws = fitted_laws(dataclasses.replace(rates, first_order=first))
    assert laws.breakage.coefficient("q") == pytest.approx(2.5, abs=0.1)
    assert laws.best_breakage is laws.breakage


def fit_record(laws):
    return json.loads(json.dumps(laws.record()))


def test_a_step_moves_with_the_cohesion_number(given):
    """P_c of two tables, at N = 0.4 and 0.6, as N^-2."""
    tables = []
    for n in (0.4, 0.6):
        one = stepped(given.rates, 0.3, 1.0, 2e-3, 6.0 * (n / 0.4898979) ** -2, 12.0)
        about = {**one.table.about, "cohesion_number": n}
        tables.append(dataclasses.replace(one, table=dataclasses.replace(one.table, about=about)))
    law = fitted_laws(tables).breakage_step
    assert law.coefficient("r") == pytest.approx(2.0, rel=1e-2)
    assert law.critical_size(0.6) / law.critical_size(0.4) == pytest.approx((0.6 / 0.4) ** -2, rel=1e-2)
    with pytest.raises(PBEError, match=r"N = 0\.9"):
        law(5.0, PHI, SHEAR_RATE, cohesion=0.9)


def test_laws_over_several_cohesion_numbers():
    every = [
        size_rates(synthetic(3 + k, 3000, cohesion_number=n), draws=19, exact_to=LARGEST, largest=LARGEST)
        for k, n in enumerate((0.4, 0.6))
    ]
    laws = fitted_laws(every)
    # Both tables are of the same probabilities: nothing depends on N.
    for law, name in ((laws.efficiency, "N"), (laws.breakage, "p")):
        at = law.names.index(name)
        assert abs(law.coefficients[at]) < 4 * np.sqrt(law.covariance[at, at]) + 0.1
    with pytest.raises(PBEError, match=r"N = 0\.9"):
        laws.efficiency(3, 4, cohesion=0.9)
    with pytest.raises(PBEError, match="cohesion number"):
        fitted_laws([every[0], size_rates(synthetic(5, 1000), draws=19)])


# -- independent solvers --------------------------------------------------------------------------------------------


def from_csv(folder, until, breakup=True):
    """A solver of one's own, from the tables alone: times and mean sizes, and the last shares in number."""
    pairs, classes = rows(folder / "pairs.csv"), rows(folder / "classes.csv")
    P = classes["P [1]"]
    i, j = pairs["class_i"].astype(int) - 1, pairs["class_j"].astype(int) - 1
    once = np.where(i == j, 0.5, 1.0)
    gain = np.zeros((len(i), P.size))
    for r, m in enumerate(P[i] + P[j]):
        if m >= P[-1]:
            gain[r, -1] = m / P[-1]
        else:
            k = np.searchsorted(P, m, side="right") - 1
            w = (m - P[k]) / (P[k + 1] - P[k])
            gain[r, k], gain[r, k + 1] = 1 - w, w
    lost = np.zeros_like(gain)
    np.add.at(lost, (np.arange(len(i)), i), 1.0)
    np.add.at(lost, (np.arange(len(i)), j), 1.0)
    change = (gain - lost) * (once * pairs["K [m^3/s]"])[:, None]
    if breakup:
        made, number = np.zeros_like(gain), rows(folder / "daughters.csv")
        row = {(a, b): r for r, (a, b) in enumerate(zip(i, j, strict=True))}
        at = [row[int(a) - 1, int(b) - 1] for a, b in zip(number["class_i"], number["class_j"], strict=True)]
        np.add.at(made, (at, number["class_k"].astype(int) - 1), number["number [1]"])
        change += (made - lost) * (once * pairs["B [m^3/s]"])[:, None]
    start = np.zeros(P.size)
    about = json.loads((folder / "fit.json").read_text())["conditions"]
    start[0] = about["volume_fraction"] / (4 / 3 * np.pi * about["primary_radius_m"] ** 3)
    times = np.linspace(0, until, 201)
    found = solve_ivp(
        lambda t, n: (n[i] * n[j]) @ change, (0, until), start, "BDF", times, rtol=1e-7, atol=1e-12 * start[0]
    )
    n = found.y.T
    return times, n @ P / n.sum(axis=1), n[-1] / n[-1].sum()


def test_a_script_from_the_tables_alone_comes_to_the_balance(given, tmp_path):
    export_table(given, "csv", tmp_path)
    _, mean, share = from_csv(tmp_path, UNTIL)
    course, steady = rows(tmp_path / "course.csv"), rows(tmp_path / "steady.csv")
    np.testing.assert_allclose(mean, course["mean_size [1]"], rtol=1e-4)
    assert np.all(
        (mean[1:] >= course["mean_size_low [1]"][1:]) & (mean[1:] <= course["mean_size_high [1]"][1:])
    )
    np.testing.assert_allclose(share, steady["share [1]"], rtol=1e-3, atol=1e-6)
    moments = rows(tmp_path / "daughter_moments.csv")
    np.testing.assert_allclose(moments["moment_1 [1]"], 1, rtol=1e-9)
    for name in tmp_path.glob("*.csv"):
        header = name.read_text().splitlines()[0].split(",")
        assert all("[" in column or column.startswith("class") for column in header), header


def test_without_breakup_there_is_aggregation_alone(without_breakup, tmp_path):
    exported = export_table(without_breakup, "csv", tmp_path)
    assert "daughters.csv" not in exported.files and "no breakup" in (tmp_path / "README.md").read_text()
    _, mean, _ = from_csv(tmp_path, 5.0, breakup=False)
    rates = without_breakup.rates
    balance = PopulationBalance(rates.grid, [Aggregation(rates.aggregation_rate.value)], edge="closed")
    n = integrate(balance, rates.grid.monodisperse(without_breakup.primaries), [0.0, 5.0])[
        -1, : rates.grid.cells
    ]
    assert mean[-1] == pytest.approx(n @ rates.pivots / n.sum(), rel=1e-5)


def test_the_script_for_matlab_runs_in_octave(given, tmp_path):
    if shutil.which("octave") is None:
        pytest.skip("GNU Octave is not installed (apt install octave)")
    export_table(given, "matlab", tmp_path)
    code = f"[t, n, m] = solve_balance('kernels.mat', {UNTIL}); printf('%.9g\\n', m(end));"
    done = subprocess.run(
        ["octave", "--no-gui", "--quiet", "--eval", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0 or "<P>" in done.stdout, done.stderr
    mean = float(done.stdout.strip().splitlines()[-1])
    assert mean == pytest.approx(float(given.solution.mean_size[-1]), rel=1e-3)


@pytest.mark.parametrize(
    "to, file", [("openfoam", "populationBalance"), ("openqbmm", "populationBalanceProperties")]
)
def test_dictionaries_are_read_back_and_give_the_rates_within_the_residual(given, tmp_path, to, file):
    """By foamlib, which shares nothing with what wrote them."""
    foamlib = pytest.importorskip("foamlib", reason="foamlib is not installed (pip install foamlib)")
    from pbekit.export import first_order as fit

    export_table(given, to, tmp_path)
    read = foamlib.FoamFile(tmp_path / file)
    rates = given.rates
    flux, broken = fit.pair_flux(given), fit.size_flux(given)
    if to == "openfoam":
        (_, kernel), (_, breakup) = read["coalescenceModels"][0], read["breakupModels"][0]
        shape, phase = read["sizeGroupShape"], read["continuousPhase"]
        K = np.full_like(flux, kernel["rate"])
        d = breakup["dP"] * (rates.pivots / shape["alphaC"]) ** (1 / shape["Df"])
        radius = (
            0.5
            * breakup["dP"]
            * ((d / breakup["dP"]) ** breakup["Df"] / breakup["kc"]) ** (1 / breakup["Df"])
        )
        S = np.sqrt(4 * phase["epsilon"] / (15 * np.pi * phase["nu"])) * np.exp(
            -breakup["B"] / (radius * phase["epsilon"])
        )
    else:
        coefficients = read["univariateCoeffs"]
        kernel, breakup = coefficients["aggregationKernel"], coefficients["breakupKernel"]
        d = 2 * given.radius * np.cbrt(rates.pivots)
        K = kernel["Ca"].value * (d[:, None] + d[None]) ** 3
        S = breakup["Cb"].value * d ** breakup["abscissaExponent"]
    text = (tmp_path / file).read_text()
    for found, table, weight, name in (
        (K, rates.aggregation_rate.value, flux, "K"),
        (S, rates.first_order.breakage.value, broken, "S"),
    ):
        again = fit.judged({}, found, table, weight)
        assert again.words in text, (name, again.words)
        assert again.typical < 1.5


@pytest.mark.slow
def test_super_droplets_of_pysdm_come_to_the_balance(given, tmp_path):
    """In a process of its own: 2^12 super-droplets over 200 s; their steady <P> scatters by 1.5 %."""
    pytest.importorskip("PySDM", reason="PySDM is not installed (pip install PySDM)")
    export_table(given, "pysdm", tmp_path)
    mean = _run(PYSDM, tmp_path)
    low, high = given.steady_mean_size[1:]
    assert 0.97 * low < mean < 1.03 * high, (mean, low, high)


@pytest.mark.slow
def test_particles_of_particula_aggregate_as_the_balance_without_breakup(given, tmp_path):
    """4000 particles until <P> is near 2: its counting error is 2 %."""
    pytest.importorskip("particula", reason="particula is not installed (pip install particula)")
    export_table(given, "particula", tmp_path)
    mean = _run(PARTICULA, tmp_path)
    rates = given.rates
    balance = PopulationBalance(rates.grid, [Aggregation(rates.aggregation_rate.value)], edge="closed")
    n = integrate(balance, rates.grid.monodisperse(given.primaries), [0.0, 20.0])[-1, : rates.grid.cells]
    assert mean == pytest.approx(n @ rates.pivots / n.sum(), rel=0.06)


def _run(program, folder):
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return float(done.stdout.strip().splitlines()[-1])


PYSDM = """
import warnings; warnings.simplefilter("ignore")
import numpy as np
from kernels_pysdm import DATA, collision
from PySDM import Formulae, Particulator
from PySDM.backends import CPU
from PySDM.environments import Box

mass, n_sd, dt = 1e-16, 2**12, 0.1
volume = 1e14 / float(DATA["n0"])
backend = CPU(Formulae(seed=1), override_jit_flags={"parallel": False})
box = Box(dt=dt, dv=volume, backend=backend)
multiplicity = np.full(n_sd, int(1e14 / n_sd))
run = Particulator(
    n_sd, environment=box, attributes={"multiplicity": multiplicity, "volume": np.full(n_sd, mass / 1000)},
    dynamics=[collision(mass, adaptive=True, dt_coal_range=(1e-6 * dt, dt))],
)
means = []
for _ in range(200):
    run.advance(10)
    w = run.attributes["multiplicity"].to_ndarray().astype(float)
    means.append((run.attributes["water mass"].to_ndarray() * w).sum() / w.sum() / mass)
print(np.mean(means[100:]))
"""

PARTICULA = """
import logging, warnings; warnings.simplefilter("ignore"); logging.disable(logging.CRITICAL)
import numpy as np
import particula as par
from kernels_particula import DATA, RADIUS, TabulatedAggregation

count, parts = 4000, par.particles
particle = (
    parts.ResolvedParticleMassRepresentationBuilder()
    .set_distribution_strategy(parts.ParticleResolvedSpeciatedMass())
    .set_activity_strategy(parts.ActivityIdealMass())
    .set_surface_strategy(parts.SurfaceStrategyVolume())
    .set_mass(np.full(count, 1000 * 4 / 3 * np.pi * RADIUS**3), "kg").set_density(1000.0, "kg/m^3").set_charge(0.0)
    .set_volume(count / float(DATA["n0"]), "m^3").build()
)
strategy = TabulatedAggregation()
strategy.random_generator = np.random.default_rng(1)
for _ in range(100):
    particle = strategy.step(particle, 298.15, 101325.0, 0.2)
print(count / (particle.get_radius() > 0).sum())
"""


# -- what is refused, and what is left ----------------------------------------------------------------------------


@pytest.mark.parametrize("to", TARGETS)
def test_every_target_writes_what_it_says(given, tmp_path, to):
    found = export_table(given, to, tmp_path)
    page = (tmp_path / "README.md").read_text()
    assert {path.name for path in tmp_path.iterdir()} == set(found.files)
    assert all(f"`{name}`" in page for name in found.files if name != "README.md")
    for part in ("What it comes to", "cannot represent", "How to check", "largest residual"):
        assert part in page
    assert len(page.splitlines()) < 70, "a page"
    with pytest.raises(PBEError, match="exists"):
        export_table(given, to, tmp_path)
    export_table(given, to, tmp_path, overwrite=True)


def test_files_of_others_are_left_alone(given, tmp_path):
    (tmp_path / "pairs.csv").write_text("a,b\n1,2\n")
    with pytest.raises(PBEError, match=r"pairs\.csv"):
        export_table(given, "csv", tmp_path, overwrite=True)
    assert (tmp_path / "pairs.csv").read_text() == "a,b\n1,2\n" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("to", ["openfoam", "openqbmm"])
def test_no_breakup_is_made_up(without_breakup, tmp_path, to):
    with pytest.raises(PBEError, match="no encounter of the table broke an aggregate"):
        export_table(without_breakup, to, tmp_path)
    assert not list(tmp_path.iterdir())


def test_an_unknown_target_is_answered_with_those_known(given, tmp_path):
    with pytest.raises(PBEError, match="expected one of csv, matlab"):
        export_table(given, "fluent", tmp_path)


def test_the_command_writes_and_answers_in_one_line(tmp_path):
    synthetic(1, 4000).save(tmp_path / "kernels.nc")
    folder = tmp_path / "out"
    arguments = ["export", str(tmp_path / "kernels.nc"), "-o", str(folder), "--draws", "19", "--until", "50"]
    done = CliRunner().invoke(app, [*arguments, "--to", "csv"])
    assert done.exit_code == 0, done.output
    assert "steady <P>" in done.output and (folder / "pairs.csv").exists()
    wrong = CliRunner().invoke(app, [*arguments, "--to", "fluent"])
    assert wrong.exit_code == 2
    (line,) = [text for text in wrong.output.splitlines() if text]
    assert line.startswith("error: --to 'fluent'") and "openfoam" in line
