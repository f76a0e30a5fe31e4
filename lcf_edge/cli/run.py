"""``lcf-edge run``: the daemon."""
# ruff: noqa: PLC0415

import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lcf_edge.config import load

if TYPE_CHECKING:
    from lcf_edge.recording.write.destination import Destination
    from lcf_edge.sinks.sink import Sink


def run(
    path: Path | None,
    settings: Sequence[str],
    destination: "Destination | None" = None,
    seconds: float | None = None,
) -> "list[Sink]":
    """Run until a signal ends it, or for ``seconds``. Return its sinks, closed.

    ``destination``: of a recording; None: as the configuration says. Raises ``ConfigError``, ``PublishError`` at the
    start, ``LcfError`` later.
    """
    config = load(path, settings)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: its threads would only cost memory
    import cv2

    from lcf_edge.compilation import uncompiled
    from lcf_edge.daemon import log
    from lcf_edge.daemon.heap import use_one_heap
    from lcf_edge.daemon.lenses import lens_for
    from lcf_edge.daemon.memory import check_budget
    from lcf_edge.daemon.service import Service
    from lcf_edge.zenoh_link.link import Link
    from lcf_edge.zenoh_link.own_gate import OwnGate, behind, gated
    from lcf_edge.zenoh_link.session import close_session, open_session

    use_one_heap()
    cv2.setNumThreads(1)
    log.take_over_standard_error()
    log.start(config.log.level)
    if reason := uncompiled():
        log.LOGGER.warning("%s", reason)
    check_budget(config)
    with ExitStack() as stack:
        options, gate = config.zenoh, None
        if endpoints := gated(options, config.publish):
            gate = OwnGate(endpoints, config.publish.prefix, partial(log.LOGGER.warning, "%s"))
            stack.callback(gate.close)
            options = behind(options, config.publish, gate.endpoint)
        opened = partial(open_session, options, config.publish)
        session = opened()
        stack.callback(close_session, session)
        link = Link(session, config, opened if options.mode != "client" else None, lens_for, gate)
        if gate is not None:
            gate.start()
        stack.pop_all()  # from here on the service closes it
    service = Service(config, link, path, settings, destination=destination, seconds=seconds)
    with service.signals_minded():
        service.run()
    return service.sinks
