"""One run from a scenario to a folder: engine, record, metrics and figures."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from ..agents.loaded_sources import loaded_sources
from ..agents.plan import Plan
from ..agents.process import Pace
from ..errors import BadInput
from ..names import LONGEST_RUN, check_length
from ..transport.faults import Kill, in_force
from ..transport.keys import Keys
from ..user_code import described
from .analysis.metrics import Metrics, write_metrics
from .figures.run_figures import draw
from .record.evaluation_pass import evaluate_run
from .record.kept_sources import keep_sources
from .record.machine import fingerprint, git_state, libraries
from .record.plan_file import write_plan
from .record.record import Record, load
from .record.recorder import BackgroundSink, Recorder
from .record.run_files import EVALUATION_PROBLEM, FIGURES_FOLDER, INFO_FILE, SCENARIO_FILE
from .scenario.fault_labels import in_words
from .scenario.paces import check_pace
from .swarm.control_server import ControlServer
from .swarm.live_faults import Injector
from .swarm.status import Status, WatchedSink
from .swarm.supervisor import Ending, Swarm
from .twin import Twin
from .whole_files import write_whole

Engine = Literal["zenoh", "twin"]
FLUSH_EVERY_S = 0.2
_LOOK_EVERY_S = 0.05


@dataclass(frozen=True)
class Options:
    """How to run: engine, pace, speed in nominal seconds per wall second, folder of runs, the hub's endpoint.

    Exact pace at speed "max" is lockstep.
    """

    engine: Engine = "zenoh"
    pace: Pace = "exact"
    speed: float | Literal["max"] = 1.0
    runs: Path = Path("runs")
    name: str | None = None
    listen: str = "tcp/127.0.0.1:0"
    figures: bool = True

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.name is not None:
            check_length(Path(self.name).name, LONGEST_RUN, "the run's name")
        if self.speed == "max":
            if self.pace == "realtime":
                raise BadInput("realtime pace goes by the wall clock: speed max is for exact pace")
            object.__setattr__(self, "pace", "lockstep")
        elif not 0 < self.speed < math.inf:
            raise BadInput(f"speed is {self.speed:g}, it must be above 0, or max")
        elif self.speed != 1 and (self.engine == "twin" or self.pace == "lockstep"):
            raise BadInput("speed scales exact and realtime pace: the twin and lockstep run as fast as they can")
        if self.pace == "lockstep":
            object.__setattr__(self, "speed", "max")

    @property
    def nominal_per_wall(self) -> float:
        """The speed as a number, infinite where nothing goes by the wall clock."""
        return math.inf if self.speed == "max" or self.engine == "twin" else self.speed


@dataclass(frozen=True)
class Outcome:
    """A finished run: its folder, its record as read from there, and what was measured."""

    folder: Path
    record: Record
    metrics: Metrics


Watch = Callable[[Status], None]


def execute(
    plan: Plan,
    scenario: str,
    options: Options,
    watch: Watch | None = None,
    files: Sequence[Path] = (),
    stop: threading.Event | None = None,
) -> Outcome:
    """Run a plan to the end, or until Ctrl-C; what was recorded until then is kept.

    Args:
        plan: what to run.
        scenario: the YAML text that the plan was made from, kept for people.
        options: how.
        watch: is shown the status some times a second.
        files: data that the scenario names, kept too.
        stop: ends the run early once it is set, from whatever thread.
    Raises:
        BadInput: the plan or an option does not fit; nothing is left behind.
        RunFailed: the swarm could not be started.
    """
    stop = stop or threading.Event()
    realtime = (options.engine, options.pace) == ("zenoh", "realtime")
    check_pace({settings.medium for settings in plan.links.values()}, plan.faults, realtime=realtime)
    is_first = not options.runs.exists()
    folder = _new_folder(options, plan.name)
    write_whole(folder / SCENARIO_FILE, scenario)
    info = _info(plan, options)
    try:
        write_plan(folder, plan)
        keep_sources(folder, loaded_sources())
        _write_info(folder, {**info, "status": "running"})
        with Recorder(folder) as recorder, _set_on_signals(stop):
            if options.engine == "twin":
                ending = _run_twin(plan, recorder, watch, stop)
            else:
                with BackgroundSink(recorder) as sink:
                    ending = _in_a_loop(_run_swarm(plan, sink, folder, options, watch, stop))
    except BadInput:
        shutil.rmtree(folder)
        if is_first:
            with contextlib.suppress(OSError):  # another run may have begun there
                options.runs.rmdir()
        raise
    except BaseException as error:
        _write_info(folder, {**info, "status": "failed", "problems": [str(error) or repr(error)]})
        raise
    keep_sources(folder, {**loaded_sources(), **ending.sources}, files)
    status = "failed" if ending.problems else "finished"
    info |= {"status": status, "problems": ending.problems, "wall_s": ending.wall_s}
    record = _evaluated(load(folder, plan, evaluated=False), folder, info)
    metrics = write_metrics(record, folder)
    if options.figures:
        draw(record, (), folder / FIGURES_FOLDER)
    return Outcome(folder, record, metrics)


def _evaluated(record: Record, folder: Path, info: dict[str, Any]) -> Record:
    """The record with its evaluation; where the user's code fails in it, run.json says so."""
    _write_info(folder, info)
    try:
        record = evaluate_run(record, folder)
    except Exception as error:  # noqa: BLE001 - the run itself is whole
        info |= {EVALUATION_PROBLEM: described(error)}
    _write_info(folder, info)
    return replace(record, info=info)


def _run_twin(plan: Plan, recorder: Recorder, watch: Watch | None, stop: threading.Event) -> Ending:
    began = time.monotonic()
    status = Status(plan)
    everybody = {agent.name for agent in plan.all_agents}

    def go_on(now_ns: int) -> bool:
        faults = in_force(plan.faults, now_ns)
        status.time_ns = now_ns
        status.alive = everybody - {fault.agent for fault in faults.values() if isinstance(fault, Kill)}
        status.faults = in_words(faults, len(plan.links))
        if watch is not None:
            watch(status)
        return not stop.is_set()

    Twin(plan, WatchedSink(recorder, status)).run(go_on)
    return Ending((), time.monotonic() - began)


@contextlib.contextmanager
def _set_on_signals(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the run and not the program; only the main thread hears of them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = signal.SIGINT, signal.SIGTERM
    before = [signal.signal(number, lambda _number, _frame: stop.set()) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def _in_a_loop(work: Coroutine[Any, Any, Ending]) -> Ending:
    """What `asyncio.run` gives; in a thread of its own where this one has a loop that runs, as in a notebook."""
    if not _runs_in_a_loop():
        return asyncio.run(work)
    with ThreadPoolExecutor(1, "volery") as thread:
        running = thread.submit(asyncio.run, work)
        while not running.done():  # waiting without end, this thread would not notice a signal that another one took
            wait([running], _LOOK_EVERY_S)
        return running.result()


def _runs_in_a_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


async def _run_swarm(
    plan: Plan, sink: BackgroundSink, folder: Path, options: Options, watch: Watch | None, stop: threading.Event
) -> Ending:
    swarm = Swarm(plan, sink, folder.name, options.pace, options.nominal_per_wall, options.listen)
    injector = Injector(swarm)
    control_server = ControlServer(swarm, injector)
    loop = asyncio.get_running_loop()

    async def look_after() -> None:
        while True:
            await asyncio.sleep(FLUSH_EVERY_S)
            sink.flush()
            swarm.status.faults = in_words(injector.in_force(), len(plan.links))
            if watch is not None:
                watch(swarm.status)

    async def stop_when_set() -> None:
        while not stop.is_set():  # noqa: ASYNC110 - it is set by signals and other threads
            await asyncio.sleep(_LOOK_EVERY_S)
        await swarm.stop()

    helpers = [
        loop.create_task(look_after()),
        loop.create_task(stop_when_set()),
        loop.create_task(control_server.serve(Keys(folder.name), folder)),
    ]
    try:
        ending = await swarm.run()
        if watch is not None:
            watch(swarm.status)
        return ending
    finally:
        for helper in helpers:
            helper.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await helper


def _new_folder(options: Options, name: str) -> Path:
    if options.name is not None:
        folder = options.runs / options.name
        if folder.parent != options.runs or options.name in ("", ".."):
            raise BadInput(f"the run's name {options.name!r} must be that of one folder: --runs chooses where it is")
        if folder.exists():
            raise BadInput(f"{folder} exists already: choose another --name, no run is overwritten")
        folder.mkdir(parents=True)
        return folder
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{name}"  # noqa: DTZ005 - local time is what its user reads
    for number in range(1, 1000):
        folder = options.runs / (stem if number == 1 else f"{stem}-{number}")
        with contextlib.suppress(FileExistsError):
            folder.mkdir(parents=True)
            return folder
    raise BadInput(f"{options.runs} has a thousand runs of {stem} already")


def _info(plan: Plan, options: Options) -> dict[str, Any]:
    """What the bits of a run depend on besides the scenario."""
    return {
        "engine": options.engine,
        "pace": options.pace if options.engine == "zenoh" else None,
        "speed": options.speed,
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "pid": os.getpid(),
        "command": sys.argv,
        "git": git_state(Path.cwd()),
        **fingerprint(),
        "libraries": libraries(plan),
    }


def _write_info(folder: Path, info: dict[str, Any]) -> None:
    write_whole(folder / INFO_FILE, json.dumps(info, indent=2))
