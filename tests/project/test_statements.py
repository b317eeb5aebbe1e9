"""Numbers that the prose states of committed data are those of the data."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

import mcdem
from mcdem.analysis.dataset import RunDataset, by_stress
from mcdem.analysis.paper_comparison import JUDGED_CONVENTION, JUDGED_REGRESSION, breakup_exponents, compare
from pbekit.tables.atlas import Atlas
from pbekit.tables.kernel_table import SOURCES, KernelTable

ROOT = Path(__file__).parents[2]
DATA = ROOT / "notebooks" / "data"
PAPER = (ROOT / "paper/paper.md").read_text(encoding="utf-8")
VALIDATION = (ROOT / "docs/validation.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def runs():
    return {path.name: RunDataset(path) for path in sorted(DATA.glob("run-*.nc"))}


def test_the_table_of_runs_is_what_the_runs_hold(runs):
    rows = re.findall(
        r"^\| `(.*?\.nc)` \|(.*)\|$", (DATA / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert {name for name, _ in rows} == set(runs)
    for name, cells in rows:
        begun, seed, until, encounters, _, each, steady = (cell.strip() for cell in cells.split("|"))
        run = runs[name]
        assert int(begun) == run.scene.population.initial, name
        assert int(seed) == run.attributes["seed"], name
        assert float(until.removesuffix(" s")) == pytest.approx(run.time[-1], abs=0.5), name
        assert int(encounters.replace(" ", "")) == len(run.outcome), name
        cpu = 1e3 * float(run.events["cpu_time"].mean())
        assert float(each.removesuffix(" ms")) == pytest.approx(cpu, abs=0.6), name
        if not run.steady.reached:
            assert steady == "-", (name, run.steady)
        else:
            assert float(steady.removesuffix(" s")) == pytest.approx(run.steady.start, abs=1.0), name


def test_the_tables_hold_as_many_designed_encounters_as_is_said():
    (most,) = re.findall(r"up to (\d+) designed encounters", (DATA / "README.md").read_text(encoding="utf-8"))
    designed = [
        int((KernelTable.load(path).records.source == SOURCES.index("designed")).sum())
        for path in sorted(DATA.glob("designed-*.nc"))
    ]
    assert max(designed) == int(most)


@pytest.mark.parametrize(
    "path", sorted(ROOT.glob("notebooks/*.ipynb")) + [ROOT / "validation/README.md"], ids=lambda p: p.name
)
def test_prose_counts_no_encounters_of_data_that_may_be_made_anew(path):
    """The counts stand in one table, above; elsewhere code prints them."""
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\d+ designed|run of \d[\d ]+ encounters", text)


def quoted(start):
    """The cell "here" of a row of the manual's table against the paper."""
    (row,) = [line for line in VALIDATION.splitlines() if line.startswith(f"| {start}")]
    return row.split("|")[3].strip()


@pytest.mark.slow
def test_the_manual_quotes_what_the_comparison_says(runs):
    groups = by_stress(run for name, run in runs.items() if name.startswith("run-"))
    rows = {row.quantity: row for row in compare(groups[1000.0])}
    words = {"length": "P on length", "size": "length on P"}[JUDGED_REGRESSION]
    d_g, k_g, d_o = (rows[f"{name}, P > 3, {words}"] for name in ("d_g", "k_g", "d_o"))

    def around(row):
        return f"{row.measured:.2f} ± {0.5 * (row.measured_high - row.measured_low):.2f}"

    assert quoted("d_g, k_g") == f"{around(d_g)}, {around(k_g)}"
    assert quoted("d_o") == around(d_o)
    assert JUDGED_CONVENTION == "paper"
    assert quoted(
        "largest fragment"
    ) == f"{rows['largest fragment 0.45 to 0.75 of the parent, its own convention'].measured:.0%}".replace(
        "%", " %"
    )
    eroded = rows["erosion's share of breakups, its own convention"]
    assert eroded.measured == 0.0 and quoted("erosion") == f"below {100 * eroded.measured_high:.2f} %"
    alone = rows["share of isolated primaries among aggregates"]
    low, high = 100 * alone.measured_low, 100 * alone.measured_high
    assert quoted("isolated") == f"{100 * alone.measured:.0f} % ({low:.0f} to {high:.0f})"
    assert quoted("σ_P") == f"{rows['σ_P/⟨P⟩, steady'].measured:.2f}"
    growth = []
    for stress in (750.0, 875.0, 1000.0):
        found = compare(groups[stress])
        (row,) = [row for row in found if row.quantity.startswith("growth from")]
        growth.append(f"{row.measured:.1f} ({row.measured_low:.1f} to {row.measured_high:.1f})")
    assert quoted("growth accelerates") == f"{', '.join(growth)} times"
    exponents = {
        row.quantity.removeprefix("breakup exponent q of "): row for row in breakup_exponents(groups)
    }
    mean, size = exponents["⟨P⟩"], exponents["P_br, its own convention"]
    assert quoted("breakup exponent") == f"{around(mean)}, {around(size)}"
    at_750 = groups[750.0][0]
    sizes = np.concatenate(
        [at_750.population(k, rigidity=False)["size"].values for k in at_750.late_snapshots]
    )
    said = re.fullmatch(
        r"([\d.]+), 95 % of them up to (\d+), none above (\d+)", quoted("mean size of the clusters")
    )
    assert said is not None
    assert float(said[1]) == round(at_750.average("mean_size").mean, 1)
    assert int(said[2]) == np.quantile(sizes, 0.95)
    assert int(said[3]) == sizes.max()
    (balance,) = re.findall(r"where the runs have ([\d., and]+?) \(a second", VALIDATION)
    measured = [runs[name].average("mean_size").mean for name in (
        "run-750Pa-of-100.nc", "run-875Pa-of-100.nc", "run-1000Pa.nc", "run-1250Pa.nc", "run-1500Pa-of-100.nc")]  # fmt: skip
    assert [float(number) for number in re.findall(r"\d+\.\d", balance)] == [
        round(value, 1) for value in measured
    ]


STRESSES = {
    750: "run-750Pa-of-100",
    875: "run-875Pa-of-100",
    1000: "run-1000Pa",
    1250: "run-1250Pa",
    1500: "run-1500Pa-of-100",
}
"""[Pa]: the run whose encounters the table of that stress holds."""


@pytest.mark.slow
def test_the_manual_quotes_what_the_balance_says(runs):
    from mcdem.kernel_tables import with_runs
    from pbekit.study.over_stresses import stress_law

    tables = [
        with_runs(KernelTable.load(DATA / f"designed-{stress}Pa.nc"), [runs[f"{name}.nc"]])
        for stress, name in STRESSES.items()
    ]
    law = stress_law(tables, draws=19)
    (steady, second, predicted) = re.findall(
        r"has steady ⟨P⟩ of (.+?) primaries .*? table holds nothing, ([\d.]+)\); .*? it predicts\s+(.+?) for the three",
        VALIDATION,
        re.DOTALL,
    )[0]
    assert [float(n) for n in re.findall(r"\d+\.\d", steady)] == [round(float(n), 1) for n in law.mean_size]
    assert float(second) == round(runs["run-1000Pa-of-100-seed-2.nc"].average("mean_size").mean, 1)
    assert re.findall(r"steady mean sizes of (.+?) primary", PAPER) == [steady]
    rows = re.findall(r"([\d.]+) \(([\d.]+) to ([\d.]+)\)", predicted)
    for k, row in enumerate(rows, start=1):
        names = ("mean_size_interpolated", "mean_size_interpolated_low", "mean_size_interpolated_high")
        found = [float(law[name].values[k]) for name in names]
        # Ends of a band move with its draws.
        assert [float(n) for n in row] == pytest.approx(found, rel=0.015), (row, found)


def test_the_manual_says_what_runs_took(runs):
    text = (ROOT / "docs/howto/accuracy.md").read_text(encoding="utf-8")
    (each,), (whole,) = (
        re.findall(rf"^\| {name} \|(.*)\|$", text, re.MULTILINE) for name in ("an encounter", "the whole run")
    )
    for cell, other, name in zip(each.split("|"), whole.split("|"), STRESSES.values(), strict=True):
        cpu = runs[f"{name}.nc"].events["cpu_time"]
        assert float(cell.replace("ms", "")) == pytest.approx(1e3 * float(cpu.mean()), abs=0.6), name
        assert float(other.replace("h", "")) == pytest.approx(float(cpu.sum()) / 3600.0, abs=0.06), name


def test_the_manual_says_what_contacts_of_the_papers_spheres_bear():
    import mcdem
    from mcdem.effects.sums import contact_equilibrium

    text = (ROOT / "docs/method/forces.md").read_text(encoding="utf-8")
    (said,) = re.findall(
        r"F_\{adh\}=([\d.]+)\$ nN, \$b_0=([\d.]+)\$ nm, equilibrium at \$h=(-[\d.]+)\$ nm, pull-off at ([\d.]+) nm, ([\d.]+) N/m",
        text,
    )
    force, radius, rest, pull_off, stiffness = map(float, said)
    scene = mcdem.load_scene(ROOT / "scenes/paper-1000Pa.toml")
    a, jkr = scene.suspension.radius, scene.effects.jkr
    assert jkr.pull_off_force(a) == pytest.approx(1e-9 * force, abs=5e-12)
    assert jkr.contact_radius(a) == pytest.approx(1e-9 * radius, abs=5e-11)
    assert jkr.pull_off_gap(a) == pytest.approx(1e-9 * pull_off, abs=5e-13)
    gap, slope = contact_equilibrium(1.0, scene.kernels.contact)
    units = scene.reduced
    assert gap * units.length == pytest.approx(1e-9 * rest, abs=5e-13)
    assert abs(slope) * units.force / units.length == pytest.approx(stiffness, abs=0.05)


def test_a_case_says_of_itself_what_its_saved_numbers_say():
    from validation import case as cases_of
    from validation import datasets
    from validation.cases import breakup_fractal_motion as motion

    because = cases_of.load("breakup_fractal_motion").because
    (said,) = re.findall(r"q of fractal clusters in motion is ([\d.]+) \+- ([\d.]+)", because)
    every = datasets.fractal_motion().values()
    firm = [row for row in every if (row["kind"], row["bonds"]) == ("fractal", motion.FIRM)]
    q, error = motion.exponent(firm, "first")
    assert said == (f"{q:.2f}", f"{error:.2f}")


def test_the_script_that_makes_the_data_imports_what_there_is():
    script = (DATA / "make.sh").read_text(encoding="utf-8")
    lines = re.findall(r"^from ([\w.]+) import (\w+)$", script, re.MULTILINE)
    assert lines
    for module, name in lines:
        assert hasattr(importlib.import_module(module), name), (module, name)


def test_the_script_that_makes_the_data_changes_keys_that_there_are():
    script = (DATA / "make.sh").read_text(encoding="utf-8")
    scene = mcdem.load_scene(ROOT / "scenes/paper-1000Pa.toml")
    changes = [
        (key, value)
        for key, values in re.findall(r'--set "?([\w.]+)=([^"\s]+(?: \w+)?)', script)
        for value in values.split(",")
    ]
    assert len(changes) >= 8
    for key, value in changes:
        scene.with_changes({key: value})


@pytest.mark.parametrize("page", ["README.md", "CHANGELOG.md", "docs/howto/kernels.md"])
def test_the_size_of_the_atlas_is_what_is_said(page):
    atlas = Atlas.load()
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    (said,) = re.findall(r"([\d ]+) encounters (?:in dimensionless|at seven|over cohesion)", text)
    assert int(said.replace(" ", "")) == round(sum(p.encounters for p in atlas.parts), -3)
    if "cohesion numbers" in text:
        assert "seven cohesion numbers" in text
        assert len(atlas.cohesion_numbers) == 7
