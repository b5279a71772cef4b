"""Work shared by processes of which none outlives an interrupt."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Protocol, TypeVar

__all__ = ["Share", "workers"]

Task = TypeVar("Task")
Found = TypeVar("Found")
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Share(Protocol):
    """What `workers` gives: (place, result) of every task, as they come."""

    def __call__(self, work: Callable[[Task], Found], tasks: Sequence[Task]) -> Iterator[tuple[int, Found]]: ...


@contextmanager
def workers(processes: int) -> Iterator[Share]:
    """Share tasks out to processes; in this one where one is enough. An interrupt ends the processes at once.

    Others run their linear algebra in one thread: on small matrices threads that wait for each other's cores cost a
    screening two to five times its time.
    """
    if processes < 2:
        yield lambda work, tasks: ((k, work(task)) for k, task in enumerate(tasks))
        return
    others = set(active_children())
    executor = ProcessPoolExecutor(processes, mp_context=get_context("spawn"))

    def share(work: Callable[[Task], Found], tasks: Sequence[Task]) -> Iterator[tuple[int, Found]]:
        with _uninterrupted(), _one_thread_each():
            placed = {executor.submit(work, task): k for k, task in enumerate(tasks)}
        for future in as_completed(placed):
            yield placed[future], future.result()

    try:
        yield share
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - others:
            child.terminate()
            child.join()
        raise
    executor.shutdown()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that begin here take no interrupt from the terminal: the one that began them ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that begin here have one thread for linear algebra, where the user did not say otherwise."""
    added = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
