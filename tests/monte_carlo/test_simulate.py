"""A run gives the same dataset, bit for bit, however it is computed and however often it is cut off."""

from __future__ import annotations

import contextlib
import errno
import importlib.util
import os
import platform
import random
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import psutil
import pytest
import synthetic
import xarray as xr
from child_signals import as_in_a_terminal

from mcdem.analysis.dataset import RunDataset
from mcdem.errors import MachineWarning, UserError
from mcdem.monte_carlo import executors, run_control
from mcdem.monte_carlo.comparison import differences
from mcdem.monte_carlo.compress import compress
from mcdem.monte_carlo.process import Process
from mcdem.monte_carlo.speculative_execution import BEGUN, PASSED, UNTOUCHED, SpeculativeExecution, ready
from mcdem.netcdf.origin import NOT_KNOWN, Machines, differing, machine
from mcdem.quantities.random_streams import stream
from mcdem.scene import load_scene

EVENTS = 700
SCRIPT = Path(__file__).parents[1] / "helpers" / "run_synthetic.py"


def run(path: Path, **options):
    given = {"events": EVENTS, "encounter": synthetic.aggregation_and_breakup, **options}
    return run_control.run(synthetic.scene(**synthetic.SMALL), path, **given)


@pytest.fixture(scope="module")
def reference(tmp_path_factory) -> Path:
    """Computed in this process, one encounter after the other, without a stop."""
    path = tmp_path_factory.mktemp("reference") / "run.nc"
    summary = run(path)
    assert summary.computed == EVENTS and summary.discarded == 0
    series = xr.open_dataset(path)
    assert series["volume"][-1] > series["volume"][0]  # doubled
    assert xr.open_datatree(path)["checkpoint"]["epoch"] > 5
    assert min(count for outcome, count in summary.outcomes.items()) > 5, summary.outcomes
    return path


# Workers


@pytest.mark.parametrize("workers", [2, 4])
def test_local_processes_give_the_same_dataset(reference, tmp_path, workers):
    summary = run(tmp_path / "run.nc", workers=workers)
    assert differences(reference, tmp_path / "run.nc") == []
    assert summary.computed - summary.discarded == EVENTS


def test_any_executor_will_do(reference, tmp_path):
    with ThreadPoolExecutor(8) as executor:
        run(tmp_path / "run.nc", executor=executor, workers=8)
    assert differences(reference, tmp_path / "run.nc") == []


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed")
@pytest.mark.filterwarnings("ignore")  # of dask's own machinery, on its way up and down
def test_a_dask_cluster_gives_the_same_dataset(reference, tmp_path):
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        executors.opened("dask", scheduler=cluster.scheduler_address) as crew,
    ):
        assert crew.workers == 2
        run(tmp_path / "run.nc", executor=crew.executor)
    assert differences(reference, tmp_path / "run.nc") == []


def mpi(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A command in the environment of these tests, three ranks to a batch job.

    Open MPI must hear that two cores and a root user will do; other MPIs ignore these variables.
    """
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(SCRIPT.parents[2]), str(SCRIPT.parent)]),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "SLURM_NTASKS": "3",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",  # up to Open MPI 4, ...
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",  # ... and from 5 on
    }
    return subprocess.run(
        arguments,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )


needs_mpi = pytest.mark.skipif(
    importlib.util.find_spec("mpi4py") is None
    or not (shutil.which("mpiexec", path=Path(sys.executable).parent) or shutil.which("mpiexec")),
    reason="mpiexec or mpi4py is not installed",
)


@needs_mpi
@pytest.mark.parametrize(
    "launcher",
    [[], pytest.param(["-m", "mpi4py.futures"], marks=pytest.mark.slow)],
    ids=["plain", "mpi4py.futures"],
)
def test_the_ranks_of_mpiexec_give_the_same_dataset(reference, tmp_path, launcher):
    path = tmp_path / "run.nc"
    arguments = [str(SCRIPT), str(path), "--events", str(EVENTS), "--executor", "mpi"]
    said = mpi("mpiexec", "-n", "3", sys.executable, *launcher, *arguments)
    assert said.returncode == 0, said.stderr
    assert said.stdout.split()[:2] == ["events", str(EVENTS)]
    assert differences(reference, path) == []


@needs_mpi
def test_the_batch_script_gives_the_dataset_of_one_process(tmp_path):
    """The very script, and real encounters; SLURM would start it like this."""
    root = SCRIPT.parents[2]
    scene, one, three = root / "scenes" / "quickstart.toml", tmp_path / "one.nc", tmp_path / "three.nc"
    said = mpi("bash", str(root / "docs" / "cluster.sbatch"), str(scene), str(three), "--events", "60")
    assert said.returncode == 0, said.stderr
    assert "60 events" in said.stdout and "ended by events" in said.stdout
    run_control.run(load_scene(scene), one, events=60)
    assert differences(one, three) == []


# Kinds of machine


class Elsewhere(Executor):
    """Computes every third encounter as a machine of another kind would."""

    def __init__(self, monkeypatch, kind: str) -> None:
        self._patch, self._kind, self._submitted = monkeypatch, kind, 0

    def submit(self, function, /, *arguments):
        self._submitted += 1
        future = Future()
        with self._patch.context() as patch:
            if self._submitted % 3 == 0:
                patch.setattr(executors, "machine", lambda: self._kind)
            future.set_result(function(*arguments))
        return future


OTHER = "x86_64 another, openblas 0.3.30 Other"


def kinds(path: Path) -> dict[str, int]:
    return Machines.read(xr.open_dataset(path).attrs["machines"], 0).counts


def test_a_dataset_counts_the_machines_of_its_encounters(reference, tmp_path, monkeypatch):
    assert kinds(reference) == {machine(): EVENTS}
    path = tmp_path / "run.nc"
    with pytest.warns(
        MachineWarning, match=r"run\.nc: .*computed with x86_64 .* now computed with .*another"
    ):
        run(path, executor=Elsewhere(monkeypatch, OTHER), workers=2)
    counted = kinds(path)
    assert set(counted) == {machine(), OTHER} and sum(counted.values()) == EVENTS
    assert counted[OTHER] == pytest.approx(EVENTS / 3, abs=0.2 * EVENTS)
    assert differences(reference, path) == []  # synthetic encounters have no round-off


def test_a_run_that_goes_on_elsewhere_says_so_once(tmp_path, monkeypatch):
    path, small = tmp_path / "run.nc", tmp_path / "small.nc"
    run(path, events=20)
    compress(path, small)
    for file in (path, small):
        with monkeypatch.context() as patch:
            patch.setattr(executors, "machine", lambda: OTHER)
            with pytest.warns(MachineWarning, match="now computed with x86_64 another") as told:
                run(file, events=30, resume=True)
            assert len(told) == 1
            run(file, events=40, resume=True)  # warnings are errors here: known by now
        assert kinds(file) == {machine(): 20, OTHER: 20}
        assert run(file, events=50, resume=True).events == 50


def test_a_kind_of_machine_names_what_rounds():
    told = machine()
    for part in ("openblas", "numba", "llvmlite", "numpy", "scipy", platform.machine()):
        assert part in told, told
    assert differing(told, told) == ("", "")
    assert differing("x86_64 a, blas 1, numba 2", "x86_64 b, blas 1, numba 3") == (
        "x86_64 a, numba 2",
        "x86_64 b, numba 3",
    )
    assert Machines.read(None, 12).counts == {NOT_KNOWN: 12}
    assert Machines.read(None, 12).computed(told) == ""  # nothing is known, nothing is said


# Discarded work


def test_discarded_encounters_are_counted(tmp_path):
    """Among three aggregates nothing ahead stands; where nothing ever changes, everything does."""

    def discarded(number: int, encounter) -> int:
        with ThreadPoolExecutor(2) as executor:
            summary = run_control.run(
                synthetic.scene(population__initial=number),
                tmp_path / f"{number}.nc",
                events=200,
                executor=executor,
                encounter=encounter,
            )
        assert summary.computed == 200 + summary.discarded
        return summary.discarded

    assert discarded(100, synthetic.always_miss) == 0
    assert 0 < discarded(40, synthetic.aggregation_and_breakup)


class Scrambled(Executor):
    """Finishes its tasks in random order; stands for the queue of finished futures too, whose `get` finishes one."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._tasks: list = []
        self._finished: list = []

    def submit(self, function, /, *arguments, **options):
        future = Future()
        self._tasks.append((future, function, arguments))
        return future

    def put(self, item) -> None:
        self._finished.append(item)

    def empty(self) -> bool:
        return not self._finished

    def get(self):
        while not self._finished:
            future, function, arguments = self._tasks.pop(self._random.randrange(len(self._tasks)))
            if future.set_running_or_notify_cancel():
                future.set_result(function(*arguments))
        return self._finished.pop(0)


@pytest.mark.parametrize("workers", [1, 3, 20])
@pytest.mark.parametrize("encounter", [synthetic.aggregation_and_breakup, synthetic.restless])
def test_the_order_in_which_encounters_are_done_does_not_matter(encounter, workers):
    def follow(process: Process, result) -> list[bytes]:
        for _ in range(600):
            ahead = process.selection.ahead(speculation.depth if result else 1)
            process_result = result(ahead) if result else compute_first(process, ahead)
            speculation.happened(process.encounter(ahead.meeting(0), process_result))
        process.record.snapshots.append(process.time, process.population)
        tables = (
            process.record.series,
            process.record.products,
            process.record.snapshots.geometries.primaries,
        )
        return [table[name].tobytes() for table in tables for name in table.variables]

    def compute(first, second, epoch, number):
        return encounter(scene, first, second, seed=stream(7, "encounter", epoch, number))

    def compute_first(process: Process, ahead):
        meeting = ahead.meeting(0)
        at = process.population.at
        return compute(at(meeting.first), at(meeting.second), meeting.epoch, meeting.number)

    scene = synthetic.scene(**synthetic.SMALL)
    histories = []
    for ahead_of_time in (False, True):
        process, pool = Process.begin(scene, 7, ()), Scrambled(workers)
        speculation = SpeculativeExecution(
            compute, pool, workers, process.population, process.selection, finished=pool
        )
        histories.append(follow(process, speculation.result if ahead_of_time else None))
    speculation.close()
    assert histories[0] == histories[1]
    assert speculation.computed == 600 + speculation.discarded
    assert speculation.discarded > 0 or workers == 1


def test_encounters_whose_aggregates_are_known_can_begin():
    first, second = np.array([0, 2, 1, 4, 5, 9, 0]), np.array([1, 3, 2, 6, 4, 8, 3])
    none = np.full(7, UNTOUCHED, dtype=np.int8)
    assert ready(first, second, none, 10).tolist() == [True, True, False, True, False, True, False]
    some = np.array([PASSED, PASSED, 0, BEGUN, 0, 0, 0], dtype=np.int8)
    assert ready(first, second, some, 10).tolist() == [False, False, True, False, False, True, True]


# Stops


def test_a_run_goes_on_where_it_stopped_as_if_it_had_not(reference, tmp_path):
    path = tmp_path / "run.nc"
    for events in (0, 1, 250, 251, EVENTS):
        summary = run(path, events=events, resume=True)
        assert summary.events == events and summary.ended_by == "events"
    assert differences(reference, path) == []


def test_a_time_reached_can_be_extended(tmp_path):
    once, twice = tmp_path / "once.nc", tmp_path / "twice.nc"
    run(once, events=None, until=0.4)
    for until in (0.1, 0.2, 0.4):
        summary = run(twice, events=None, until=until, resume=True)
        assert summary.time == until and summary.ended_by == "time"
    assert differences(once, twice) == []
    assert run(twice, events=None, until=0.3, resume=True).time == 0.4  # nothing is taken back
    times = xr.open_datatree(once)["snapshots"]["time"].values
    assert times == pytest.approx(0.05 * np.arange(9))


def test_inversion_goes_on_too(tmp_path):
    once, twice = tmp_path / "once.nc", tmp_path / "twice.nc"
    scene = synthetic.scene(**synthetic.SMALL, numerics__event_selection="inverse_transform")
    for path, stops in ((once, (300,)), (twice, (120, 300))):
        for events in stops:
            run_control.run(
                scene, path, events=events, resume=True, encounter=synthetic.aggregation_and_breakup
            )
    assert differences(once, twice) == []


def start(path: Path, *options: str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(SCRIPT.parents[2]), str(SCRIPT.parent)])}
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(path), *options, "--encounter", "slow_aggregation_and_breakup"],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=as_in_a_terminal,
    )


def wait_for(condition, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def stored_events(path: Path) -> int:
    return xr.open_dataset(path).sizes["row"] - 1 if path.exists() else -1


def test_killed_at_three_random_moments_it_gives_the_same_dataset(reference, tmp_path):
    path = tmp_path / "run.nc"
    moments = random.Random()
    for _ in range(3):
        before = stored_events(path)
        process = start(path, "--events", str(EVENTS), "--workers", "2")
        wait_for(lambda before=before: stored_events(path) > max(before, 0))
        time.sleep(moments.uniform(0.0, 0.3))
        workers = psutil.Process(process.pid).children(recursive=True)
        process.kill()
        process.wait()
        _, alive = psutil.wait_procs(workers, timeout=20)
        assert not alive  # nobody computes for a leader that is dead
        assert stored_events(path) > before
        process.stdout.close()
    summary = run(path, resume=True)
    assert summary.events == EVENTS
    assert summary.computed < EVENTS  # not all over again
    assert differences(reference, path) == []


@pytest.mark.parametrize(
    ("number", "workers"), [(signal.SIGINT, "1"), (signal.SIGTERM, "2"), (signal.SIGHUP, "1")]
)
def test_asked_to_stop_it_leaves_a_whole_dataset(reference, tmp_path, number, workers):
    path = tmp_path / "run.nc"
    process = start(path, "--events", str(EVENTS), "--workers", workers)
    wait_for(lambda: stored_events(path) > 0)
    process.send_signal(number)
    said, _ = process.communicate(timeout=600)
    assert process.returncode == 0
    assert said.startswith("interruption")
    events = int(said.split()[1])
    assert 0 < events < EVENTS
    assert stored_events(path) == events
    run(path, resume=True)
    assert differences(reference, path) == []


def test_a_defect_of_an_encounter_is_reported_and_what_came_before_it_is_kept(tmp_path):
    path = tmp_path / "run.nc"
    with pytest.raises(ArithmeticError, match="three is a crowd"):
        run(path, encounter=synthetic.broken)
    assert stored_events(path) > 0


def test_a_dead_worker_is_reported_and_what_came_before_it_is_kept(tmp_path):
    path = tmp_path / "run.nc"
    with pytest.raises(UserError, match=r"a worker died.*--resume"):
        run(path, encounter=synthetic.deadly, workers=2)
    assert stored_events(path) > 0


def test_a_run_needs_an_end_and_a_seed_in_range(tmp_path):
    with pytest.raises(UserError, match="when to stop"):
        run(tmp_path / "run.nc", events=None)
    for until in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(UserError, match="until = "):
            run(tmp_path / "run.nc", events=None, until=until)
    with pytest.raises(UserError, match="seed = -1"):
        run(tmp_path / "run.nc", seed=-1)
    assert not (tmp_path / "run.nc").exists()


@pytest.mark.parametrize("restructuring", [True, False])
def test_without_restructuring_aggregates_go_on_as_they_came(tmp_path, restructuring):
    scene = synthetic.scene(**synthetic.SMALL, population__restructuring=restructuring)
    run_control.run(scene, tmp_path / "run.nc", events=400, encounter=synthetic.aggregation_and_breakup)
    run = RunDataset(tmp_path / "run.nc")
    first = np.cumsum(run.events["number_of_products"].values) - run.events["number_of_products"].values
    same = np.flatnonzero(np.isin(run.outcome, ("missed", "parted")))
    out = np.stack([run.events["product_outer_radius"].values[first[same] + k] for k in (0, 1)], axis=1)
    came = run.events["parent_outer_radius"].values[same]
    assert len(same) > 50
    assert (np.sort(out) == np.sort(came)).all() != restructuring


def test_the_last_aggregate_ends_the_run(tmp_path):
    scene = synthetic.scene(population__initial=5, population__doubling_below=0)
    summary = run_control.run(scene, tmp_path / "run.nc", events=10**6, encounter=synthetic.always_merge)
    assert (summary.ended_by, summary.events) == ("one aggregate left", 4)
    summary = run_control.run(
        scene, tmp_path / "run.nc", until=2.5, resume=True, encounter=synthetic.always_merge
    )
    assert (summary.ended_by, summary.time) == ("time", 2.5)


def test_progress_says_where_the_run_stands(tmp_path):
    said = []
    summary = run(tmp_path / "run.nc", progress=said.append)
    last = said[-1]
    assert (last.events, last.time, last.outcomes, last.done) == (EVENTS, summary.time, summary.outcomes, 1.0)
    assert last.mean_size == xr.open_dataset(summary.path)["mean_size"][-1]


# Faults from outside


def test_a_clock_that_jumps_does_not_touch_the_process(reference, tmp_path, monkeypatch):
    """The system's time may be set back or forth by days: what is computed and when it is written do not hang on it."""
    jumps = random.Random(1)
    monkeypatch.setattr(time, "time", lambda: 1e9 * jumps.random())
    monkeypatch.setattr(time, "time_ns", lambda: int(1e18 * jumps.random()))
    said = []
    summary = run(tmp_path / "run.nc", progress=said.append)
    assert summary.elapsed >= 0.0 and all(p.remaining is None or p.remaining >= 0.0 for p in said)
    assert differences(reference, tmp_path / "run.nc") == []


def test_a_disk_that_fills_while_a_run_goes_is_reported_and_costs_nothing(reference, tmp_path, monkeypatch):
    """The disk fills at the third writing: one clear line; what was written before is whole, and the run goes on from it."""
    from pbekit import files

    path, writings = tmp_path / "run.nc", []

    def full(beside):
        writings.append(beside)
        if len(writings) > 4:  # a file and its folder for each writing
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(files, "_to_disk", full)
        patch.setattr(run_control, "SHARE_OF_WRITING", 1e9)
        with pytest.raises(
            UserError, match=r"cannot be written \(.*No space left.*intact.*--resume"
        ) as caught:
            run(path, checkpoint_every=0.0)
        assert "\n" not in str(caught.value)
    assert stored_events(path) == 1
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".part"] == []
    run(path, resume=True)
    assert differences(reference, path) == []


@pytest.mark.slow
def test_killed_at_twenty_random_moments_it_gives_the_same_dataset(reference, tmp_path):
    """Whenever SIGKILL comes, from the first import on, while it computes or while it writes."""
    path = tmp_path / "run.nc"
    moments = random.Random(2)
    for _ in range(20):
        before = stored_events(path)
        process = start(path, "--events", str(EVENTS), "--workers", "1")
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(moments.uniform(0.5, 6.0))
        process.kill()
        process.wait()
        process.stdout.close()
        assert stored_events(path) >= before
    run(path, resume=True)
    assert differences(reference, path) == []
