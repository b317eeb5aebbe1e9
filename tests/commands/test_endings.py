"""Every long command ends when it is asked to: at once, in one line, with what was computed kept and a code that says why."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, Executor, Future
from pathlib import Path

import numpy as np
import pbe_synthetic
import pytest
import synthetic
import xarray as xr
from child_signals import as_in_a_terminal
from typer.testing import CliRunner

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.dimensionless_groups import check
from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import UserError
from mcdem.monte_carlo import executors, run_control
from mcdem.monte_carlo.comparison import differences
from mcdem.monte_carlo.executors import ExecutorError, Here
from mcdem.monte_carlo.expected_output import MOST_UNCHANGED, output_of
from mcdem.monte_carlo.process import multiples
from mcdem.monte_carlo.sweep import sweep
from pbekit import arguments, endings
from pbekit.commands.main import app
from pbekit.tables.kernel_table import KernelTable

ROOT = Path(__file__).parents[2]
SCRIPT = Path(__file__).parents[1] / "helpers" / "interrupted_program.py"
SCENE = ROOT / "scenes" / "quickstart.toml"
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(SCRIPT.parent)])}


def ended(process: subprocess.Popen[str], number: int) -> tuple[int, str, float]:
    """Exit code, stderr and seconds that it took, of a program that is asked to end."""
    asked = time.monotonic()
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    return process.returncode, said, time.monotonic() - asked


def started(*command: str | Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *map(str, command)],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=as_in_a_terminal,
    )


def wait_for(condition, process: subprocess.Popen[str], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("kernels") / "table.nc"
    records = pbe_synthetic.design(np.random.default_rng(8), 4000, 24, critical=8.0, pieces=3)
    about = {"volume_fraction": 0.04}
    KernelTable.of(records, pbe_synthetic.RADIUS, pbe_synthetic.SHEAR_RATE, shapes=1, about=about).save(path)
    return path


COMMANDS = {
    "run": (signal.SIGTERM, ["run", SCENE, "-o", "out.nc", "--workers", 1], "out.nc holds all.*--resume"),
    "kernels": (signal.SIGINT, ["kernels", SCENE, "-o", "out.nc", "--workers", 1], "out.run.nc holds.*same command"),
    "cost": (signal.SIGINT, ["cost", SCENE, "--quick", "--workers", 1], r"cost.png and .* hold \d+ of \d+ settings"),
    "efficiency": (signal.SIGHUP, ["efficiency", SCENE], "nothing was written"),
    "solve": (signal.SIGINT, ["solve", "table.nc", "-o", "out.nc", "--draws", 9999, "--until", 2], "out.nc holds.*bands"),
    "validation": (signal.SIGTERM, ["1", "-o", "report", "--workers", 1], "report/kept holds.*same command"),
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_ends_in_one_line_and_keeps_what_it_has(command, table, tmp_path, monkeypatch):
    number, arguments, words = COMMANDS[command]
    monkeypatch.chdir(tmp_path)
    Path("table.nc").symlink_to(table)
    program = {"solve": "pbekit", "validation": "validation"}.get(command, "mcdem")
    process = started(SCRIPT, "begun", program, *arguments)
    wait_for(Path("begun").exists, process)
    code, said, seconds = ended(process, number)
    last = said.splitlines()[-1]
    assert code == 128 + number, said
    assert last.startswith("interrupted: ")
    assert "Traceback" not in said and said.count("interrupted") == 1
    assert seconds < (30.0 if command == "cost" else 5.0)  # it draws what it has

    assert re.search(words, last), last
    if command == "run":
        assert len(RunDataset("out.nc").events["time"]) >= 5
    if command == "solve":
        data = xr.load_dataset("out.nc")
        assert "mean_size_low" not in data and "interrupted" in data.attrs["no_band"]
        assert data.attrs["steady_mean_size"] > 1 and "steady_mean_size_low" not in data.attrs


@pytest.mark.parametrize("number", endings.REQUESTS)
def test_a_program_is_ready_to_be_interrupted_before_it_loads_anything(number):
    slow = "import signal, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    slow += "from pbekit import endings\n"
    slow += "endings.program(lambda: (print('ready', flush=True), time.sleep(60)))"
    process = started("-c", slow)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    code, said, _ = ended(process, number)
    assert (code, said) == (128 + number, "interrupted: nothing was written\n")


def test_nothing_that_takes_time_is_loaded_before_that():
    heavy = ["numpy", "numba", "scipy", "typer", "netCDF4", "mcdem.commands.main", "pbekit.commands.main"]
    program = f"import sys, mcdem.__main__, pbekit.__main__\nprint([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", program], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_what_is_to_be_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with endings.listening():
            os.kill(os.getpid(), signal.SIGHUP)
            assert not endings.asked()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_what_must_not_be_cut_in_two_is_not():
    done = []
    with pytest.raises(KeyboardInterrupt), endings.Deferred() as interruption:
        os.kill(os.getpid(), signal.SIGTERM)
        done.append("whole")
        with interruption.allowed():
            done.append("never")
    assert done == ["whole"]
    assert endings.exit_code() == 143


# -- nothing to wait for ----------------------------------------------------------------------------------------------


def test_times_of_a_balance_are_finite_and_a_course_that_came_to_rest_ends(table, tmp_path):
    def solve(until, *more):
        return CliRunner().invoke(
            app, ["solve", str(table), "-o", str(tmp_path / "out.nc"), "--until", until, *more]
        )

    for until in ("inf", "nan", "1e300", "0"):
        done = solve(until)
        assert done.exit_code == 2 and f"--until {float(until)}: expected a time above 0" in done.output
    assert not (tmp_path / "out.nc").exists()
    assert [arguments.until(given) for given in ("90 s", "90s", "1.5 min", "9e4 ms", "90", 90.0)] == [
        90.0
    ] * 6
    done = solve("1e9 s", "--samples", "5")
    assert done.exit_code == 0, done.output
    assert "at rest from t = " in done.output
    data = xr.load_dataset(tmp_path / "out.nc")
    assert 1e2 < data.attrs["at_rest_from"] < 1e7
    assert float(data.mean_size[-1]) == pytest.approx(data.attrs["steady_mean_size"], rel=1e-3)
    assert abs(float(data.mass_drift[-1])) < 1e-9


EMPTY = {"run__snapshot_every": "1 ms", "population__initial": 60}


def test_an_empty_stretch_costs_nothing_wherever_a_run_is_cut_off(tmp_path):
    """Some 2e8 snapshots would be due; and 35 within a stretch that is cut in two."""
    scene = synthetic.scene(suspension__volume_fraction=1e-12, **EMPTY)
    options = {"encounter": synthetic.aggregation_and_breakup}
    run_control.run(scene, tmp_path / "empty.nc", events=15, **options)
    run = RunDataset(tmp_path / "empty.nc")
    assert run.time[-1] > 1e4
    assert len(run.snapshot_times) <= MOST_UNCHANGED * 16 + 1
    # The population between two encounters is that of the last snapshot before.
    for row in range(len(run.time) - 1):
        last = np.flatnonzero(run.snapshot_times <= run.time[row + 1])[-1]
        if run.snapshot_times[last] > run.time[row]:
            assert len(run.aggregates(last)) == run.series["number_of_aggregates"][row]

    scene = synthetic.scene(suspension__volume_fraction=2e-6, **EMPTY)
    run_control.run(scene, tmp_path / "whole.nc", until=2.0, **options)
    for until in np.linspace(0.1, 2.0, 11):
        run_control.run(scene, tmp_path / "parts.nc", until=float(until), resume=True, **options)
    assert differences(tmp_path / "whole.nc", tmp_path / "parts.nc") == []
    gaps = np.diff(RunDataset(tmp_path / "whole.nc").snapshot_times)
    assert gaps.max() > 2e-3 and np.median(gaps) == pytest.approx(1e-3)


def test_multiples_are_those_that_come_one_by_one():
    for every in (0.1, 0.05, 1.0, 1 / 3):
        said, time = [], 0.0
        for end in np.random.default_rng(1).uniform(0.0, 3 * every, 40).cumsum():
            said += [n * every for n in multiples(every, time, time, float(end))]
            time = float(end)
        assert said == [n * every for n in range(len(said))] and said[-1] < time <= len(said) * every


def test_what_a_run_will_write_is_said_beforehand():
    ordinary = output_of(synthetic.scene(), events=1000)
    assert ordinary is not None and not ordinary.large
    assert output_of(synthetic.scene()) is None
    dense = synthetic.scene(run__until="1e5 s", run__snapshot_every="1 us")
    output = output_of(dense)
    assert output is not None and output.large and "snapshot_every" in output.words
    (finding,) = [f for f in check(dense) if f.name == "bytes of the dataset"]
    assert finding.verdict == "warning"
    assert not [f for f in check(synthetic.scene(run__until="100 s")) if f.name == finding.name]


@pytest.mark.slow
def test_what_is_said_is_what_comes(tmp_path):
    scene = synthetic.scene(**EMPTY, suspension__volume_fraction=1e-5)
    path = tmp_path / "run.nc"
    run_control.run(scene, path, events=2000, encounter=synthetic.always_miss)
    said, run = output_of(scene, events=2000), RunDataset(path)
    assert said is not None
    assert said.snapshots == pytest.approx(len(run.snapshot_times), rel=0.3)
    assert said.size == pytest.approx(path.stat().st_size, rel=0.5)


# -- engines ---------------------------------------------------------------------------------------------------------


class Lost(Executor):
    """An engine that fails in mid-run, in one of the ways of engines."""

    def __init__(self, problem: BaseException, in_submit: bool = False) -> None:
        self.problem, self.in_submit, self.tasks = problem, in_submit, 0

    def submit(self, function, /, *arguments, **options):
        self.tasks += 1
        future: Future = Future()
        if self.tasks > 20:
            if self.in_submit:
                raise self.problem
            future.set_exception(self.problem)
        else:
            future.set_result(function(*arguments, **options))
        return future


class KilledWorkerError(Exception):
    """As dask's."""


@pytest.mark.parametrize(
    ("problem", "in_submit"),
    [
        (CancelledError(), False),
        (KilledWorkerError("a\nb"), False),
        (OSError("closed"), False),
        (RuntimeError("after shutdown"), True),
        (MemoryError(), False),
    ],
)
def test_an_executor_may_fail_in_any_way(tmp_path, problem, in_submit):
    path, scene = tmp_path / "run.nc", synthetic.scene(**synthetic.SMALL)
    options = {"events": 40, "encounter": synthetic.aggregation_and_breakup}
    with pytest.raises(ExecutorError, match=r"run.nc holds everything until t = .*--resume") as caught:
        run_control.run(scene, path, executor=Lost(problem, in_submit), **options)
    assert "\n" not in str(caught.value)
    assert 0 < len(RunDataset(path).events["time"]) < 40


def test_a_sweep_whose_cluster_is_lost_can_go_on(tmp_path):
    scene = synthetic.scene(**synthetic.SMALL)
    lost = Lost(CancelledError())
    lost.tasks = 20
    with pytest.raises(ExecutorError, match="the same command goes on"):
        sweep(scene, tmp_path, {"flow.viscosity": ["75 mPa s"]}, events=5, executor=lost)
    assert "waiting" in (tmp_path / "index.csv").read_text()


def test_a_tasks_own_failure_is_not_the_executors():
    def fails():
        raise ZeroDivisionError("its own")

    with pytest.raises(ZeroDivisionError, match="its own"):
        executors.result_of(executors.submit(Here(), fails))


@pytest.mark.skipif(sys.platform != "linux", reason="asks the processes of the machine")
def test_workers_end_in_the_middle_of_a_task():
    began = time.monotonic()
    with contextlib.suppress(KeyboardInterrupt), executors.local_processes(1) as pool:
        executors.result_of(executors.submit(pool, time.monotonic))  # it is there
        executors.submit(pool, time.sleep, 60.0)
        time.sleep(0.1)
        raise KeyboardInterrupt
    assert time.monotonic() - began < 10.0


# -- how many --------------------------------------------------------------------------------------------------------


def test_workers_are_bounded_by_what_there_is(monkeypatch):
    monkeypatch.delenv(executors.MOST_WORKERS)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2})
    monkeypatch.setattr(os, "process_cpu_count", lambda: 8, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert executors.processors() == 3
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "2")
    assert executors.processors() == 2
    with pytest.raises(UserError, match=r"workers = 100000: expected 1 to 2, .*MCDEM_MOST_WORKERS"):
        executors.opened("process", 100_000).__enter__()
    monkeypatch.setenv(executors.MOST_WORKERS, "5")
    assert executors.number_of(5, executors.processors(), "") == 5
    assert executors.number_of(None, executors.processors(), "") == 2
    for stated in ("many", "0"):
        monkeypatch.setenv(executors.MOST_WORKERS, stated)
        with pytest.raises(UserError, match="MCDEM_MOST_WORKERS = "):
            executors.number_of(5, 2, "")


# -- long pieces of compiled code -----------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [0.3, 0.9])
def test_where_compiled_code_is_cut_touches_no_bit(offset, monkeypatch):
    """Steps one by one, and all at once."""
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter import motion as integrate
    from mcdem.scene import load_scene

    scene = load_scene(ROOT / "scenes" / "paper-750Pa.toml")
    radius = scene.suspension.radius
    found = []
    for longest in (0.0, 1e9):
        monkeypatch.setattr(integrate, "LONGEST_PIECE", longest)
        one = Aggregate.monomer()
        result = simulate_encounter(scene, one, one, (0.0, offset * radius), seed=0)
        found.append((result.outcome, result.steps, result.centres.tobytes(), result.largest_tension))
    assert found[0] == found[1]
