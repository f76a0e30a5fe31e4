"""Queries and their answers: ``<prefix>/query/<name>``."""

import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import zenoh

CAPACITY = 16  # queries that wait; of more, the newest are kept
ENDING_S = 0.2  # for the thread's end, unless a client does not listen

Answer = Callable[[], tuple[bytes, str] | str]
"""A payload and its encoding, or why there is none."""


class Queryables:
    """Answers queries for each name in a thread of its own, so that a client that does not listen delays no other.

    ``counts``: ``answered``, ``refused`` (there was no answer yet), ``failed``, ``overtaken`` (by newer ones while
    they waited), ``unknown`` (no name was meant).
    """

    COUNTED = frozenset(("answered", "refused", "failed", "overtaken", "unknown"))

    def __init__(self, session: zenoh.Session, prefix: str, answers: Mapping[str, Answer]) -> None:
        self.counts: Counter[str] = Counter(dict.fromkeys(self.COUNTED, 0))
        self._answers = {zenoh.KeyExpr(f"{prefix}/query/{name}"): answer for name, answer in answers.items()}
        self._waiting: deque[zenoh.Query] = deque()
        self._changed = threading.Condition()
        self._closed = False
        take: Any = zenoh.handlers.Callback(self._take, indirect=False)  # no queue in between
        self._queryable: Any = session.declare_queryable(f"{prefix}/query/*", take)
        self._thread = threading.Thread(target=self._run, name="zenoh queries", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop answering; may be called twice."""
        with suppress(zenoh.ZError):  # it was closed before
            self._queryable.undeclare()
        with self._changed:
            self._closed = True
            self._waiting.clear()
            self._changed.notify()
        self._thread.join(ENDING_S)

    def _take(self, query: zenoh.Query) -> None:
        with self._changed:
            if len(self._waiting) == CAPACITY:
                self.counts["overtaken"] += 1
                self._waiting.popleft()  # its end tells the client that no answer comes
            self._waiting.append(query)
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                query = self._waiting.popleft()
            self._answer(query)
            del query  # else it would end only with the next one

    def _answer(self, query: zenoh.Query) -> None:
        """Answer a query. When it is dropped by the last name, the client learns that no more answers follow."""
        meant = {key: answer for key, answer in self._answers.items() if query.key_expr.intersects(key)}
        for key, answer in meant.items():
            self.counts[_reply(query, key, answer())] += 1
        self.counts["unknown"] += not meant


def _reply(query: zenoh.Query, key: zenoh.KeyExpr, answer: tuple[bytes, str] | str) -> str:
    """Reply to a query. Return the outcome, as it is counted."""
    try:
        if isinstance(answer, str):
            query.reply_err(answer)
            return "refused"
        payload, encoding = answer
        query.reply(key, payload, encoding=zenoh.Encoding(encoding))
    except zenoh.ZError:  # the client has gone
        return "failed"
    return "answered"
