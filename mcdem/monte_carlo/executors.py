"""Where encounters are computed: here, in local processes, or on a cluster (choose one).

Anything that keeps the contract of `concurrent.futures.Executor` will do; this file only opens the usual ones and makes
sure that each worker runs its linear algebra on one thread.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import threadpoolctl

from mcdem.errors import UserError
from mcdem.quantities.random_streams import stream

if TYPE_CHECKING:
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult
    from mcdem.scene import Scene

KINDS = ("process", "mpi", "dask")


class Crew(NamedTuple):
    """Workers and how many they are."""

    executor: Executor
    workers: int


class Here(Executor):
    """Computes in this process, at once."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(function(*args, **kwargs))
        return future


@contextlib.contextmanager
def opened(
    kind: str = "process", workers: int | None = None, scheduler: str | None = None, apart: bool = False
) -> Iterator[Crew]:
    """The workers that the command line names.

    kind : "process" for this machine (one worker computes in this very process), "mpi" for the ranks of `mpiexec -n N mcdem ...`,
        "dask" for the cluster of the scheduler at `scheduler`
    workers : how many; None for all that there are
    apart : even a single worker is another process than this
    """
    with contextlib.ExitStack() as stack:
        if kind == "process":
            workers = workers or os.cpu_count() or 1
            yield Crew(
                stack.enter_context(local_processes(workers)) if workers > 1 or apart else Here(), workers
            )
        elif kind == "mpi":
            crew = stack.enter_context(_mpi())
            yield Crew(crew.executor, workers or crew.workers)
        elif kind == "dask":
            crew = stack.enter_context(_dask(scheduler))
            yield Crew(crew.executor, workers or crew.workers)
        else:
            raise UserError(f'executor = "{kind}": expected one of {", ".join(KINDS)}')


@contextlib.contextmanager
def local_processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes of this machine, each started afresh: compiled threads and locks do not survive a fork."""
    executor = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_stay_with_parent
    )
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _stay_with_parent() -> None:
    """Leave Ctrl-C to the parent, and end when it is killed: a worker that waits for a task would never notice."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def wait_and_leave() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=wait_and_leave, daemon=True).start()


@contextlib.contextmanager
def _mpi() -> Iterator[Crew]:
    """The first rank leads; the others compute for it and end with it, never to return from here."""
    try:
        from mpi4py import MPI
        from mpi4py.futures import MPICommExecutor
    except ImportError as problem:
        raise UserError(
            f'executor = "mpi": mpi4py cannot be loaded ({problem}); pip install mpi4py'
        ) from None
    ranks = MPI.COMM_WORLD.Get_size()
    if ranks < 2:
        raise UserError(
            'executor = "mpi": found 1 rank, expected at least 2, the first of which leads; '
            "start with: mpiexec -n 3 mcdem ..."
        )
    with MPICommExecutor(MPI.COMM_WORLD) as pool:
        executor = cast("Executor | None", pool)  # None where a rank has served and may leave
        if executor is not None:
            yield Crew(executor, ranks - 1)
    if executor is None:
        raise SystemExit(0)


@contextlib.contextmanager
def _dask(scheduler: str | None) -> Iterator[Crew]:
    try:
        from distributed import Client
    except ImportError as problem:
        raise UserError(
            f'executor = "dask": distributed cannot be loaded ({problem}); pip install distributed'
        ) from None
    if scheduler is None:
        raise UserError(
            'executor = "dask": give the address of its scheduler, e.g. --scheduler tcp://host:8786'
        )
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as problem:
        raise UserError(f'scheduler = "{scheduler}": cannot be reached ({problem})') from None
    with client:
        workers = sum(client.ncores().values())
        if not workers:
            raise UserError(
                f'scheduler = "{scheduler}": has no workers; start some with: dask worker {scheduler}'
            )
        yield Crew(client.get_executor(pure=False), workers)


def width(executor: Executor) -> int:
    """How many tasks an executor of a known kind runs at once; 1 if it does not tell."""
    client = getattr(executor, "_client", None)  # dask
    if client is not None:
        return sum(client.ncores().values()) or 1
    for name in ("_max_workers", "num_workers"):  # concurrent.futures, mpi4py
        if value := getattr(executor, name, None):
            return int(value)
    return 1


# What a worker does

Encounter = Callable[..., "EncounterResult"]
"""`simulate_encounter`, or what stands for it: (scene, first, second, seed=generator) -> result."""


def computation(
    scene: Scene, encounter: Encounter, seed: int, executor: Executor
) -> Callable[..., EncounterResult]:
    """The function (first, second, epoch, number) -> result, in a form fit for the executor."""
    if isinstance(executor, Here):
        return partial(_compute, scene, encounter, seed)
    return partial(_compute_packed, pickle.dumps((scene, encounter, seed)))


def _compute(
    scene: Scene,
    encounter: Encounter,
    seed: int,
    first: Aggregate,
    second: Aggregate,
    epoch: int,
    number: int,
) -> EncounterResult:
    return encounter(scene, first, second, seed=stream(seed, "encounter", epoch, number))


def _compute_packed(
    packed: bytes, first: Aggregate, second: Aggregate, epoch: int, number: int
) -> EncounterResult:
    return _compute(*_unpacked(packed), first, second, epoch, number)


@lru_cache(maxsize=8)
def _unpacked(packed: bytes) -> tuple[Scene, Encounter, int]:
    """Once a worker and scene; from then on its linear algebra runs on one thread."""
    threadpoolctl.threadpool_limits(limits=1)
    return pickle.loads(packed)
