"""Where the runs of a sweep are carried out: processes on the cores of this machine, or a Dask cluster.

Both hand out a few runs at a time and give results back as they come, so that little is lost when they are ended.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from itertools import chain, islice
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

from ...errors import BadInput, RunFailed
from ..swarm.spawning import plain_main
from .sweep_plan import Job, made_with
from .sweep_runs import Values, run_job

_AHEAD = 2
"""Runs that each worker has been given: the one that it works on, and the next."""
_ANSWER_S = 10.0
_DIED = "a worker of the sweep died: the same command goes on where it was"
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Done(NamedTuple):
    """A finished run."""

    job: Job
    values: Values


Pool = Callable[[Iterable[Job]], Generator[Done, None, None]]
"""Carries out runs, and gives them in the order in which they finish; closing it ends those that are on the way."""


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0))


def local_pool(workers: int) -> Pool:
    """Processes on this machine, each with one thread.

    They end with this process, whatever it ends by, and Ctrl-C does not reach them: who started them decides.

    Raises:
        BadInput: no worker.
    """
    if workers < 1:
        raise BadInput(f"--workers {workers}: at least one process must do the work")

    def carry_out(jobs: Iterable[Job]) -> Generator[Done, None, None]:
        waiting = iter(jobs)
        first = list(islice(waiting, workers))
        most = len(first)
        if not first:
            return
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        before = multiprocessing.active_children()
        with ProcessPoolExecutor(most, context, _begin_worker, (theirs,)) as executor:
            try:
                with _as_workers_begin():
                    for _ in range(most):
                        executor.submit(int)  # each starts a process, as none is idle yet
                yield from _in_turn(
                    chain(first, waiting), lambda job: executor.submit(run_job, job), _any_of, most * _AHEAD
                )
            except BrokenProcessPool as error:
                raise RunFailed(_DIED) from error
            except BaseException:
                _end([worker for worker in multiprocessing.active_children() if worker not in before])
                executor.shutdown(wait=True, cancel_futures=True)
                raise
            finally:
                theirs.close()
                ours.close()

    return carry_out


@contextlib.contextmanager
def _as_workers_begin() -> Iterator[None]:
    """Processes that are started within have one thread for linear algebra, and do not receive Ctrl-C."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with plain_main():
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value


def _end(workers: Iterable[BaseProcess]) -> None:
    """End workers in the middle of what they do, with what they have started."""
    for worker in workers:
        assert worker.pid is not None
        try:
            os.killpg(worker.pid, signal.SIGTERM)
        except ProcessLookupError:  # it is no group of its own yet
            worker.terminate()


def _begin_worker(line: Connection) -> None:
    """Be a process group of its own that ends, with what it started, when the other end of the line is closed."""
    os.setpgid(0, 0)

    def end_with_owner() -> None:
        with contextlib.suppress(EOFError, OSError):
            line.recv()
        os.killpg(0, signal.SIGTERM)

    threading.Thread(target=end_with_owner, daemon=True).start()


def _any_of(futures: Iterable[Future[Values]]) -> Iterable[Future[Values]]:
    return wait(futures, return_when=FIRST_COMPLETED).done


def _in_turn(
    jobs: Iterable[Job],
    submit: Callable[[Job], Any],
    any_of: Callable[[Iterable[Any]], Iterable[Any]],
    ahead: int,
) -> Iterator[Done]:
    """Results as they come, with so many runs handed out at a time."""
    waiting = iter(jobs)
    out = {submit(job): job for job in islice(waiting, ahead)}
    while out:
        for future in any_of(list(out)):
            job = out.pop(future)
            yield Done(job, future.result())
            out.update({submit(following): following for following in islice(waiting, 1)})


def dask_pool(address: str, answer_s: float = _ANSWER_S) -> Pool:
    """The workers of a Dask cluster, by the address of its scheduler, such as tcp://10.0.0.1:8786.

    Raises:
        BadInput: dask is not installed, that is no address, or the scheduler does not answer in time.
    """
    distributed = _distributed()
    _check_address(distributed, address)
    try:
        client = distributed.Client(address, timeout=answer_s, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = f"it does not answer within {answer_s:g} s ({error})"
        raise BadInput(f"--scheduler {address}: {reason}: start one with `dask scheduler`") from error

    def any_of(futures: Iterable[Any]) -> Iterable[Any]:
        return [next(distributed.as_completed(futures, loop=client.loop))]

    def carry_out(jobs: Iterable[Job]) -> Generator[Done, None, None]:
        lost = (distributed.KilledWorker, CancelledError, OSError)
        with client:
            _check_workers(client, address)
            threads = sum(client.nthreads().values())
            try:
                yield from _in_turn(jobs, lambda job: client.submit(run_job, job, pure=False), any_of, threads * _AHEAD)
            except lost as error:
                raise RunFailed(f"the cluster lost a run ({error}); the same command goes on where it was") from error

    return carry_out


def _check_address(distributed: Any, address: str) -> None:
    """Refuse what is no address before a client is made of it: such a client waits for nobody when it is dropped."""
    try:
        distributed.comm.get_address_host(address)
    except ValueError as error:
        raise BadInput(f"--scheduler {address}: {error}: write an address such as tcp://10.0.0.1:8786") from error


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError as error:
        raise BadInput("--scheduler needs dask, which is not installed: pip install 'volery[dask]'") from error


def _check_workers(client: Any, address: str) -> None:
    """Refuse a cluster without workers, or one whose workers would make other bits."""
    there = client.run(made_with)
    if not there:
        raise BadInput(f"--scheduler {address}: it has no workers: start some with `dask worker {address}`")
    here = made_with()
    for worker, versions in there.items():
        if differ := [name for name, value in here.items() if versions.get(name) != value]:
            raise BadInput(f"--scheduler {address}: worker {worker} has other {', '.join(differ)} than this process")
