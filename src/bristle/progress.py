"""Progress of long work, shown by the caller."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many steps are done, and how many there are."""


def step(progress: Progress | None, what: str) -> None:
    """Tell what begins, where the number of steps is unknown."""
    if progress:
        progress(what, 0, 1)


def teller(progress: Progress | None, total: int) -> Callable[[str], None]:
    """A function that tells the next of so many steps; silent without `progress`."""
    done = count()

    def tell(what: str) -> None:
        if progress:
            progress(what, next(done), total)

    return tell


@contextmanager
def shown() -> Iterator[Progress]:
    """A progress bar on standard error, if a terminal, removed at the end. Slow imports belong inside."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description:<42}", markup=False), BarColumn(20), TimeElapsedColumn())
    console = Console(stderr=True)
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task, last = bar.add_task("starting", total=None), "starting"

        def update(what: str, done: int, total: int) -> None:
            nonlocal last
            many = total > 1
            line = f"{what} ({min(done + 1, total)} of {total})" if many else what
            bar.tasks[0].total = total if many else None
            bar.update(task, description=line, completed=done, refresh=what != last)  # no step is too short to be shown
            last = what

        yield update
