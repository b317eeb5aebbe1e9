"""What `mcdem cost` and `mcdem sensitivity` share: their files, their workers and pairs, and an end before the last setting."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

from mcdem.errors import UserError

if TYPE_CHECKING:
    from mcdem.analysis.paired_encounters import Pair
    from mcdem.netcdf.whole_files import Kind
    from mcdem.scene import Scene
    from pbekit.progress import ProgressBar

Result = TypeVar("Result")
LEAST = 2
"""Settings that are worth writing: fewer compare nothing."""


def figure_and_table(figure: Path, kind: Kind, overwrite: bool) -> tuple[Path, Path]:
    """The figure and the table beside it, if they may be written; raises `UserError` if not."""
    from mcdem.netcdf.whole_files import FILES

    table = figure.with_suffix(".csv")
    FILES.check_picture(figure, overwrite=overwrite)
    FILES.check(table, kind, overwrite=overwrite)
    return figure, table


@contextlib.contextmanager
def opened(
    scene: Scene, runs: Sequence[Path], count: int, seed: int, events: int, workers: int | None
) -> Iterator[tuple[Executor, list[Pair], ProgressBar]]:
    """Workers, the pairs that meet under every setting, and what shows how far it is."""
    from mcdem.analysis.paired_encounters import sample_for
    from mcdem.monte_carlo import executors
    from pbekit.progress import ProgressBar

    with executors.opened("process", workers) as crew, ProgressBar(scene.name) as progress:
        yield (
            crew.executor,
            sample_for(
                scene,
                runs,
                count,
                seed,
                events=events,
                workers=crew.workers,
                executor=crew.executor,
                progress=progress,
            ),
            progress,
        )


def until_stopped(
    results: Iterable[Result], note: Callable[[Result], None]
) -> tuple[list[Result], BaseException | None]:
    """All results, or those before Ctrl-C or a failure of the workers if they are worth writing, and what that was."""
    from mcdem.monte_carlo.executors import ExecutorError

    found: list[Result] = []
    try:
        for result in results:
            found.append(result)
            note(result)
    except (KeyboardInterrupt, ExecutorError) as problem:
        if len(found) < LEAST:
            raise
        return found, problem
    return found, None


def end_early(problem: BaseException, files: str, done: int, wanted: int) -> NoReturn:
    """End a comparison of settings that was cut off, by the user or by a failure, after it wrote what it had."""
    words = f"{files} hold {done} of {wanted} settings; given again with --overwrite the command begins anew"
    if isinstance(problem, KeyboardInterrupt):
        raise KeyboardInterrupt(words) from None
    raise UserError(f"{problem}; {words}") from None
