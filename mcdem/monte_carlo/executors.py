"""Where encounters are computed: here, in local processes, or on a cluster (choose one).

Anything that keeps the contract of `concurrent.futures.Executor` will do; this file only opens the usual ones, makes sure that
each worker runs its linear algebra on one thread, and separates a failure of the executor (a worker died, a cluster was
closed, a connection broke) from one of the task itself: `submit` and `result_of`.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.resource_tracker
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import threadpoolctl

from mcdem.arguments import ExecutorKind
from mcdem.errors import UserError
from mcdem.netcdf.origin import machine
from mcdem.quantities.random_streams import stream
from pbekit import endings

if TYPE_CHECKING:
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult
    from mcdem.scene import Scene


class Crew(NamedTuple):
    """Workers and how many they are."""

    executor: Executor
    workers: int


class Here(Executor):
    """Computes in this process, at once."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as problem:
            future.set_exception(problem)
        return future


# Failures of the executor


class ExecutorError(UserError):
    """The executor failed, in whatever way: the task it was given may be done again on another."""


@dataclass(frozen=True)
class Failed:
    """What came of a task that failed by itself: its own exception, which says where it was raised."""

    problem: Exception


def guarded(task: Callable[..., Any], *args: Any) -> Any:
    """On a worker: what a task returns, or how it failed."""
    try:
        return task(*args)
    except MemoryError:
        raise  # the worker's
    except Exception as problem:
        if multiprocessing.parent_process() is not None:
            problem.add_note(f"on a worker: {traceback.format_exc()}")
        return Failed(problem)


def submit(executor: Executor, task: Callable[..., Any], *args: Any) -> Future[Any]:
    """Give a task to an executor; its result is for `result_of`.  Raises `ExecutorError`."""
    try:
        return executor.submit(guarded, task, *args)
    except Exception as problem:
        raise _executor_error(problem) from problem


def result_of(future: Future[Any]) -> Any:
    """The result of a task; raises the task's own exception, and `ExecutorError` for any other."""
    try:
        result = future.result()
    except (KeyboardInterrupt, SystemExit):
        raise
    except (
        BaseException
    ) as problem:  # BrokenExecutor, CancelledError of two kinds, KilledWorker, CommClosedError ...
        raise _executor_error(problem) from problem
    if isinstance(result, Failed):
        raise result.problem
    return result


def _executor_error(problem: BaseException) -> ExecutorError:
    said = " ".join(str(problem).split())
    return ExecutorError(
        "what computes the encounters failed: a worker died, of lack of memory or by another's hand, or the cluster was "
        f"closed ({type(problem).__name__}{': ' + said[:200] if said else ''})"
    )


# How many

MOST_WORKERS = "MCDEM_MOST_WORKERS"
"""Environment variable that states how many workers are allowed where the machine does not report it rightly."""


def processors() -> int:
    """Processors that this process may use: of the machine, less what its affinity or the scheduler's share leaves out."""
    count = getattr(os, "process_cpu_count", os.cpu_count)() or 1
    if hasattr(os, "sched_getaffinity"):
        count = min(count, len(os.sched_getaffinity(0)))
    share = os.environ.get("SLURM_CPUS_PER_TASK", "")
    return min(count, int(share)) if share.isdecimal() and int(share) > 0 else count


def number_of(asked: int | None, there: int, what: str) -> int:
    """How many workers there will be: as many as asked for, all that are `there` by default; raises `UserError`."""
    stated = os.environ.get(MOST_WORKERS, "")
    if stated and not (stated.isdecimal() and int(stated) > 0):
        raise UserError(f'{MOST_WORKERS} = "{stated}": expected a number of workers, 1 or more')
    if asked is None:
        return there
    most = max(there, int(stated)) if stated else there
    if not 1 <= asked <= most:
        raise UserError(
            f"workers = {asked}: expected 1 to {most}, {what}; the environment variable {MOST_WORKERS} states another bound"
        )
    return asked


@contextlib.contextmanager
def opened(
    kind: str = "process", workers: int | None = None, scheduler: str | None = None, apart: bool = False
) -> Iterator[Crew]:
    """The workers that the command line names.

    kind : "process" for this machine (one worker computes in this very process), "mpi" for the ranks of `mpiexec -n N mcdem ...`,
        "dask" for the cluster of the scheduler at `scheduler`
    workers : how many, at most as many as there are (`number_of`); None for all of them
    apart : even a single worker is another process than this
    """
    with contextlib.ExitStack() as stack:
        if kind == "process":
            workers = number_of(workers, processors(), "the processors that this process may use")
            yield Crew(
                stack.enter_context(local_processes(workers)) if workers > 1 or apart else Here(), workers
            )
        elif kind == "mpi":
            crew = stack.enter_context(_mpi())
            yield Crew(crew.executor, number_of(workers, crew.workers, "the ranks that compute"))
        elif kind == "dask":
            crew = stack.enter_context(_dask(scheduler))
            yield Crew(
                crew.executor, number_of(workers, crew.workers, "the threads of the cluster's workers")
            )
        else:
            raise UserError(f'executor = "{kind}": expected one of {", ".join(ExecutorKind)}')


class _Processes(ProcessPoolExecutor):
    """Processes that leave what is unfinished when nobody wants it any more."""

    def __init__(self, workers: int) -> None:
        super().__init__(
            workers, mp_context=multiprocessing.get_context("spawn"), initializer=_stay_with_parent
        )
        self._unfinished: set[Future[Any]] = set()

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        with contextlib.nullcontext() if self._processes else _unheard():
            future = super().submit(function, *args, **kwargs)
        self._unfinished.add(future)
        future.add_done_callback(self._unfinished.discard)
        return future

    def leave(self) -> None:
        """End the processes, in the middle of a task too: an encounter may take minutes."""
        processes = list((self._processes or {}).values())
        self.shutdown(wait=False, cancel_futures=True)
        if any(not future.done() for future in list(self._unfinished)):
            for process in processes:
                process.kill()
        self.shutdown(wait=True)


@contextlib.contextmanager
def local_processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes of this machine, each started afresh: compiled threads and locks do not survive a fork."""
    executor = _Processes(workers)
    try:
        yield executor
    finally:
        executor.leave()


LEFT_TO_THE_PARENT = tuple(number for number in endings.REQUESTS if number != signal.SIGTERM)
"""SIGTERM stays deadly: it is how a pool ends its workers when one of them has died."""


@contextlib.contextmanager
def _unheard() -> Iterator[None]:
    """Processes started within hear no Ctrl-C until they are ready to ignore it: each would print a traceback."""
    multiprocessing.resource_tracker.ensure_running()  # which would undo the mask
    before = signal.pthread_sigmask(signal.SIG_BLOCK, LEFT_TO_THE_PARENT)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _stay_with_parent() -> None:
    """Leave Ctrl-C to the parent, and end when it is killed: a worker that waits for a task would never notice.

    So with a terminal that is closed.
    """
    for number in LEFT_TO_THE_PARENT:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, LEFT_TO_THE_PARENT)
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
    if MPI.COMM_WORLD.Get_rank():  # mpiexec passes signals on to every rank; the first answers for all
        for number in endings.REQUESTS:
            signal.signal(number, signal.SIG_IGN)
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
    """How many tasks an executor of a known kind runs at once; 1 if it does not say."""
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
    """The function (first, second, epoch, number) -> result, in a form fit for the executor; options go on to the encounter."""
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
    **options: Any,
) -> EncounterResult:
    result = encounter(scene, first, second, seed=stream(seed, "encounter", epoch, number), **options)
    return replace(result, machine=machine())


def _compute_packed(
    packed: bytes, first: Aggregate, second: Aggregate, epoch: int, number: int, **options: Any
) -> EncounterResult:
    return _compute(*_unpacked(packed), first, second, epoch, number, **options)


@lru_cache(maxsize=8)
def _unpacked(packed: bytes) -> tuple[Scene, Encounter, int]:
    """Once a worker and scene; from then on its linear algebra runs on one thread."""
    threadpoolctl.threadpool_limits(limits=1)
    return pickle.loads(packed)
