"""Who does the work: processes on this computer, or the workers of a Dask cluster."""

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TYPE_CHECKING

from lcf_edge import __version__
from lcf_edge.errors import LcfError
from lcf_edge.evaluate.one_recording import Done, Task, evaluate

if TYPE_CHECKING:
    from distributed import Client

PATIENCE_S = 10.0  # for reaching a scheduler
ANXIETY_S = 30.0  # without a result, after which the cluster is looked at

Outcome = tuple[Task, Done | str]
"""A task and its result; text: why it failed."""

Say = Callable[[str], None]


def by_processes(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Run the tasks in processes on this computer; yield in the order in which they end.

    A recording that ends its process, say by a fault in a decoder, is reported as failed, but no other one.
    """
    waiting = deque(tasks)
    while waiting:
        suspects: list[Task] = []
        with _pool(jobs) as pool:
            for task, future in _ended(pool, 2 * jobs, waiting):
                if isinstance(future.exception(), BrokenProcessPool):
                    suspects.append(task)
                else:
                    yield task, _result(future)
        for task in suspects:
            with _pool(1) as pool:
                with interrupts_held():
                    future = pool.submit(evaluate, task, task.frames_before())
                yield task, _result(future)


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    fresh = multiprocessing.get_context("spawn")  # inherits none of this process's threads and locks
    pool = ProcessPoolExecutor(jobs, mp_context=fresh, initializer=_end_by_interrupt)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold back Ctrl-C while a worker starts: one that is not yet ready, or loses its parent, prints a traceback.

    The worker inherits the mask. Here the mask is not enough: another thread takes the signal, and Python runs
    its handler in this one.
    """
    came = False

    def keep(_signal: int, _frame: object) -> None:
        nonlocal came
        came = True

    before = signal.signal(signal.SIGINT, keep)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        if came:
            signal.raise_signal(signal.SIGINT)


def _end_by_interrupt() -> None:
    """End silently at Ctrl-C, which reaches the workers too."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def by_cluster(tasks: Sequence[Task], endpoint: str, say: Say) -> Iterator[Outcome]:
    """Run the tasks on the workers of a Dask scheduler, which see the recordings under the same paths.

    The tasks of a lost worker go to another. Raises ``LcfError`` when there is no scheduler, or none of its
    workers has this version of the program.
    """
    try:
        from distributed import Client  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise LcfError(
            "--scheduler needs the package distributed; install it: pip install 'lcf-edge[cluster]'"
        ) from error
    try:
        client = Client(endpoint, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise LcfError(f"{endpoint}: no Dask scheduler there ({error}); start one: dask scheduler") from error
    with client:
        _refuse_strangers(client, endpoint)

        def look() -> None:
            if not client.nthreads():
                say(f"{endpoint}: no worker is left; start one: dask worker {endpoint}")

        width = 2 * sum(client.nthreads().values())
        for task, future in _ended(client.get_executor(pure=False), width, deque(tasks), look):
            yield task, _result(future)


def _refuse_strangers(client: "Client", endpoint: str) -> None:
    """Refuse workers of another version, whose results would differ. One that is lost meanwhile is not asked again."""
    answers = client.run(_version, on_error="return")
    versions = {worker: answer for worker, answer in answers.items() if not isinstance(answer, OSError)}
    if not versions:
        raise LcfError(f"{endpoint}: the scheduler has no workers; start one: dask worker {endpoint}")
    for worker, version in versions.items():
        if version != __version__:
            found = f"lcf-edge {version}" if isinstance(version, str) else "no working lcf-edge"
            raise LcfError(f"{worker}: {found} there, {__version__} here; install the same version on all workers")


def _version() -> str:
    return __version__


def _ended(
    executor: Executor, width: int, waiting: deque[Task], look: Callable[[], None] = lambda: None
) -> Iterator[tuple[Task, Future[Done]]]:
    """Hand out tasks, ``width`` at a time, until there are none or the executor is broken. ``look``: nothing came."""
    running: dict[Future[Done], Task] = {}
    is_broken = False
    while running or (waiting and not is_broken):
        while waiting and len(running) < width and not is_broken:
            try:
                with interrupts_held():
                    future = executor.submit(evaluate, waiting[0], waiting[0].frames_before())
                running[future] = waiting.popleft()
            except BrokenProcessPool:
                is_broken = True
        done, _ = wait(running, timeout=ANXIETY_S, return_when=FIRST_COMPLETED)
        if not done:
            look()
        for future in done:
            is_broken |= isinstance(future.exception(), BrokenProcessPool)
            yield running.pop(future), future


def _result(future: Future[Done]) -> Done | str:
    error = future.exception()
    if error is None:
        return future.result()
    return f"its process ended ({type(error).__name__}: {' '.join(str(error).split())[:300]})"
