"""The command line: runs a command, prints its results, and every error as one line on standard error.

Exit status: 0 done, 1 failed at run time, 2 wrong usage or configuration, 130 interrupted, 141 the reader
of the output went away. What a command needs is imported when it runs, so that ``--help`` is quick.
"""

import argparse
import atexit
import io
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from lcf_edge.cli.arguments import parser
from lcf_edge.cli.namesake import namesake
from lcf_edge.errors import LcfError, UsageError
from lcf_edge.image_limit import limit_opencv
from lcf_edge.printable import printable

if other := namesake("drivers"):
    sys.exit(f"lcf-edge: {other}: it hides our package of the same name; rename it, or start in another folder")

from drivers.errors import DriverError

if TYPE_CHECKING:
    from lcf_edge.cli.calibrate import Task
    from lcf_edge.config import Config
    from lcf_edge.monitor.live.daemon_address import DaemonAddress
    from lcf_edge.monitor.replay.replayed import Replayed
    from lcf_edge.recording.pace import Pace


def program(argv: Sequence[str] | None = None) -> NoReturn:
    """Be the program: run the command of its arguments, or of ``argv``, and end."""
    status = 1

    def end_despite_threads() -> None:
        """End at once where a thread still runs, such as one that a hanging device keeps.

        Python before 3.14 ends it wherever it is; in the C++ of a library that aborts the program.
        """
        if threading.active_count() > 1:
            sys.stdout.flush()
            os._exit(status)

    atexit.register(end_despite_threads)  # first, so it is called last
    status = main(argv)
    sys.exit(status)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command. Return the exit status."""
    limit_opencv()
    for closed in ("stdout", "stderr"):
        if getattr(sys, closed) is None:  # closed by the shell, as with >&-
            setattr(sys, closed, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may lack Greek letters
    try:
        try:
            arguments = parser().parse_args(argv)
            _COMMANDS[arguments.command](arguments)
        finally:
            _write_lines()  # also what argparse printed
    except LcfError as error:
        _say(f"lcf-edge: {error}")
        return error.exit_status
    except DriverError as error:
        _say(f"lcf-edge: {error}")
        return 1
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        _abandon_stdout()
        return 141
    return 0


def _load(arguments: argparse.Namespace) -> "Config":
    from lcf_edge.config import load  # noqa: PLC0415

    return load(arguments.config, arguments.set)


def _config(arguments: argparse.Namespace) -> None:
    config = _load(arguments)
    from lcf_edge.cli.config import report  # noqa: PLC0415

    _write_lines(report(config))


def _doctor(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.doctor import doctor  # noqa: PLC0415

    doctor(arguments.config, arguments.set, as_json=arguments.json, write_line=_write_lines)


def _run(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.run import run  # noqa: PLC0415

    run(arguments.config, arguments.set)


def _record(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.record import record  # noqa: PLC0415

    _write_lines(record(arguments.file, arguments.seconds, arguments.config, arguments.set))


def _daemon_address(arguments: argparse.Namespace) -> "DaemonAddress":
    from lcf_edge.config.endpoint import fault  # noqa: PLC0415
    from lcf_edge.monitor.live.daemon_address import DaemonAddress  # noqa: PLC0415

    wrong = fault(arguments.connect)
    if wrong:
        raise LcfError(f"--connect: {wrong}")
    return DaemonAddress(arguments.connect, arguments.prefix, arguments.zenoh_config)


def _pace(arguments: argparse.Namespace) -> "Pace":
    from lcf_edge.recording.pace import Pace  # noqa: PLC0415

    return Pace(arguments.start, arguments.duration, arguments.speed, arguments.loop, arguments.step)


def _shown(arguments: argparse.Namespace) -> "DaemonAddress | Replayed":
    """Return the named recording, else the daemon. Raises ``UsageError`` for options of the other one."""
    from lcf_edge.recording.pace import Pace  # noqa: PLC0415

    pace = _pace(arguments)
    if arguments.recording is None:
        if pace != Pace() or arguments.config or arguments.set:
            raise UsageError(f"{arguments.command}: these options need a recording; name RECORDING")
        return _daemon_address(arguments)
    from lcf_edge.monitor.replay.replayed import Replayed  # noqa: PLC0415

    return Replayed(arguments.recording, _load(arguments), pace)


def _watch(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.watch import watch_lines, watch_table  # noqa: PLC0415

    if arguments.json:
        if arguments.recording is not None:
            raise UsageError("watch: --json is for a daemon; lcf-edge replay RECORDING -o - writes a line a frame")
        watch_lines(_daemon_address(arguments), _write_lines)
    else:
        watch_table(_shown(arguments), _write_lines)


def _gate(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.gate import gate  # noqa: PLC0415

    gate(arguments.tls, arguments.listen, arguments.port, arguments.to, _write_lines)


def _view(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.view import view  # noqa: PLC0415

    view(_shown(arguments), arguments.listen, arguments.port, _write_lines)


def _foxglove(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.foxglove import foxglove  # noqa: PLC0415

    foxglove(_daemon_address(arguments), arguments.port, _write_lines)


def _replay(arguments: argparse.Namespace) -> None:
    config = _load(arguments)
    from lcf_edge.cli.replay import Outputs, replay  # noqa: PLC0415

    outputs = Outputs(arguments.results, arguments.video, arguments.plot, arguments.publish, arguments.mcap)
    pace = _pace(arguments)
    if arguments.realtime and pace.speed is None:
        pace = replace(pace, speed=1.0)
    summary = replay(arguments.recording, config, outputs, pace, lambda text: _say(f"lcf-edge: warning: {text}"))
    if arguments.results == "-":
        print(*summary, sep="\n", file=sys.stderr)
    else:
        _write_lines(*summary)


def _evaluate(arguments: argparse.Namespace) -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the daemon, in each process
    from lcf_edge.cli.evaluate import Work, evaluate  # noqa: PLC0415
    from lcf_edge.evaluate.evaluation import Question  # noqa: PLC0415

    question = Question(arguments.recordings, arguments.config, arguments.set, arguments.truth, arguments.against)
    work = Work(arguments.jobs, arguments.scheduler)
    _write_lines(*evaluate(question, arguments.out, work, lambda text: _say(f"lcf-edge: warning: {text}")))


def _task(arguments: argparse.Namespace) -> "Task":
    from lcf_edge.cli.calibrate import Task  # noqa: PLC0415

    return Task(
        _load(arguments),
        arguments.config,
        arguments.recording,
        arguments.report,
        arguments.write,
        getattr(arguments, "seconds", None),
    )


def _calibrate(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli import calibrate  # noqa: PLC0415

    if arguments.what == "camera" and arguments.print_board:
        _write_lines(*calibrate.print_board(arguments.board, arguments.print_board))
        return
    task = _task(arguments)
    match arguments.what:
        case "camera":
            _write_lines(*calibrate.camera(task, arguments.board, arguments.model, arguments.views))
        case "imu" if arguments.at_rest:
            _write_lines(*calibrate.imu_at_rest(task))
        case "imu" if arguments.by_camera:
            _write_lines(*calibrate.imu_by_camera(task, arguments.snap))
        case "imu":
            _write_lines(*calibrate.imu_by_motions(task, arguments.snap))
        case "foe":
            _write_lines(*calibrate.foe(task))
        case "time":
            _write_lines(*calibrate.time(task))
        case "mask" if arguments.draw:
            _write_lines(*calibrate.mask_drawn(task, arguments.polygon, arguments.port))
        case "mask":
            _write_lines(*calibrate.mask(task, arguments.polygon))


def _demo(arguments: argparse.Namespace) -> None:
    from lcf_edge.cli.demo import demo  # noqa: PLC0415

    demo(arguments.out, arguments.seconds, _write_lines)


def _bench(arguments: argparse.Namespace) -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the daemon
    from lcf_edge.cli.bench import bench  # noqa: PLC0415

    bench(arguments.seconds, _write_lines)


_COMMANDS: Mapping[str, Callable[[argparse.Namespace], None]] = {
    "demo": _demo,
    "replay": _replay,
    "evaluate": _evaluate,
    "run": _run,
    "record": _record,
    "watch": _watch,
    "gate": _gate,
    "view": _view,
    "foxglove": _foxglove,
    "doctor": _doctor,
    "calibrate": _calibrate,
    "config": _config,
    "bench": _bench,
}


def _say(text: str) -> None:
    """Print one line on standard error, without control characters."""
    print(printable(" ".join(text.split()), 2000), file=sys.stderr)


def _write_lines(*lines: str) -> None:
    """Print lines on standard output and flush, so that a failure is noticed here, not at exit."""
    try:
        sys.stdout.writelines(f"{line}\n" for line in lines)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _abandon_stdout()
        raise LcfError(f"standard output: cannot be written ({error.strerror}); free the disk") from error


def _abandon_stdout() -> None:
    """Send the interpreter's last flush nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
