"""Another process on the network, which knows nothing of this project: does what it reads on standard input.

``python peer.py CONFIG``, a Zenoh configuration as JSON; each line in is a request, each line out its result.
"""

import base64
import json
import queue
import sys
import threading
import time
from typing import Any

import zenoh

PATIENCE_S = 20.0
PRIORITIES = (zenoh.Priority.REAL_TIME, zenoh.Priority.INTERACTIVE_HIGH, zenoh.Priority.DATA, zenoh.Priority.BACKGROUND)


class Peer:
    def __init__(self, settings: dict[str, Any]) -> None:
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self.samples: dict[str, queue.Queue[zenoh.Sample]] = {}
        self.kept: list[Any] = []

    def connected(self, timeout_s: float = PATIENCE_S) -> bool:
        """Whether somebody is there in time; Zenoh does not report it to those who ask later."""
        deadline_s = time.monotonic() + timeout_s
        info: Any = self.session.info
        while not (list(info.peers_zid()) or list(info.routers_zid())):
            if time.monotonic() > deadline_s:
                return False
            time.sleep(0.005)
        return True

    def subscribe(self, key: str) -> None:
        self.samples[key] = queue.Queue()
        self.kept.append(self.session.declare_subscriber(key, self.samples[key].put))

    def receive(self, key: str, count: int, timeout_s: float) -> list[dict[str, Any]]:
        """The next samples; fewer when no more came."""
        received: list[dict[str, Any]] = []
        try:
            while len(received) < count:
                received.append(described(self.samples[key].get(timeout=timeout_s)))
        except queue.Empty:
            pass
        return received

    def put(self, key: str, payload: str, encoding: str, count: int) -> bool:
        """Whether somebody subscribed in time."""
        publisher = self.session.declare_publisher(
            key, encoding=encoding, congestion_control=zenoh.CongestionControl.BLOCK
        )
        matched = threading.Event()
        with publisher.declare_matching_listener(lambda status: matched.set() if status.matching else None):
            somebody = publisher.matching_status.matching or matched.wait(PATIENCE_S)
        for _ in range(count):
            publisher.put(base64.b64decode(payload))
        publisher.undeclare()
        return somebody

    def put_blindly(self, key: str, payload: str) -> None:
        """Whether or not somebody subscribed."""
        self.session.put(key, bytes.fromhex(payload), congestion_control=zenoh.CongestionControl.BLOCK)

    def put_forever(self, keys: list[str]) -> None:
        """As fast as it can."""
        while True:
            for key in keys:
                self.session.put(key, b"")

    def delete(self, key: str) -> None:
        self.session.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)

    def answer(self, key: str, payload: str) -> None:
        """Answer whatever is asked there."""
        self.kept.append(self.session.declare_queryable(key, lambda query: query.reply(key, bytes.fromhex(payload))))

    def finds(self, key: str) -> bool:
        """Whether somebody who answers there is known in time: a query before that has no reply."""
        matched = threading.Event()
        with self.session.declare_querier(key) as querier:
            querier.declare_matching_listener(lambda status: matched.set() if status.matching else None)
            return querier.matching_status.matching or matched.wait(PATIENCE_S)

    def announce(self, key: str) -> None:
        """Declare a liveliness token."""
        self.kept.append(self.session.liveliness().declare_token(key))

    def announce_many(self, key: str, count: int) -> None:
        """Declare so many liveliness tokens."""
        self.kept += [self.session.liveliness().declare_token(f"{key}/{n}") for n in range(count)]

    def offer_many(self, key: str, count: int) -> None:
        """Declare so many publishers."""
        self.kept += [self.session.declare_publisher(f"{key}/{n}") for n in range(count)]

    def offer(self, keys: list[str]) -> None:
        """Declare publishers."""
        self.kept += [self.session.declare_publisher(key) for key in keys]

    def matched(self, key: str) -> bool:
        """Whether somebody seems to subscribe; what was declared before an answer is known by then."""
        publisher = self.session.declare_publisher(key)
        list(self.session.get("lcf/query/schema", timeout=PATIENCE_S))
        return bool(publisher.matching_status.matching)

    def put_large(self, key: str, size: int, count: int) -> None:
        """Whether or not somebody subscribed, at each priority."""
        for number in range(count):
            priority = PRIORITIES[number % len(PRIORITIES)]
            self.session.put(key, bytes(size), congestion_control=zenoh.CongestionControl.BLOCK, priority=priority)

    def get(self, key: str, timeout_s: float = PATIENCE_S) -> list[dict[str, Any]]:
        replies = self.session.get(key, timeout=timeout_s, target=zenoh.QueryTarget.ALL)
        return [
            described(reply.ok) if reply.ok else {"error": reply.err.payload.to_string()} for reply in list(replies)
        ]

    def flood(self, key: str, count: int) -> None:
        """Ask, and ask, and at last listen to the answers."""
        asked = [self.session.get(key, timeout=PATIENCE_S) for _ in range(count)]
        for replies in asked:
            list(replies)

    def say_everything(self, key: str, payload: str) -> None:
        """Whatever a session can, and take it back."""
        session, content = self.session, bytes.fromhex(payload)
        publisher = session.declare_publisher(key, encoding="application/cdr")
        querier = session.declare_querier(key)
        declared = [
            publisher,
            querier,
            *(session.declare_subscriber(each, _ignore) for each in (key, "lcf/**", "lcf/*/a", "**")),
            session.declare_queryable(f"{key}/answer", _ignore),
            session.liveliness().declare_token(f"{key}/token"),
            session.liveliness().declare_subscriber("lcf/@alive/**", _ignore, history=True),
        ]
        publisher.put(content, attachment=b"attached", timestamp=session.new_timestamp())
        publisher.delete(timestamp=session.new_timestamp())
        session.put(session.declare_keyexpr(f"{key}/other"), content, encoding="text/plain;utf-8", express=True)
        session.put(key, content, source_info=zenoh.SourceInfo(publisher.id, 7))
        for number, priority in enumerate(PRIORITIES):
            reliability = (zenoh.Reliability.RELIABLE, zenoh.Reliability.BEST_EFFORT)[number % 2]
            session.declare_publisher(key, priority=priority, reliability=reliability).put(bytes(10_000))
        list(querier.get(payload=content, parameters="a=1", attachment=b"attached"))
        consolidation = zenoh.ConsolidationMode.NONE
        list(session.get(key, payload=content, encoding="text/plain", consolidation=consolidation, timeout=1.0))
        list(session.liveliness().get("lcf/@alive/*", timeout=1.0))
        for one in declared:
            one.undeclare()

    def tokens(self, key: str) -> list[str]:
        return sorted(str(reply.ok.key_expr) for reply in self.session.liveliness().get(key, timeout=PATIENCE_S))


def _ignore(_: object) -> None:
    pass


def described(sample: zenoh.Sample) -> dict[str, Any]:
    attachment = sample.attachment.to_bytes() if sample.attachment else b""
    return {
        "key": str(sample.key_expr),
        "payload": base64.b64encode(sample.payload.to_bytes()).decode(),
        "encoding": str(sample.encoding),
        "attachment": base64.b64encode(attachment).decode(),
        "congestion_control": str(sample.congestion_control).rpartition(".")[2],
        "priority": str(sample.priority).rpartition(".")[2],
        "express": sample.express,
    }


def main() -> None:
    peer = Peer(json.loads(sys.argv[1]))
    for line in sys.stdin:
        request = json.loads(line)
        result = getattr(peer, request.pop("do"))(**request)
        sys.stdout.write(json.dumps(result) + "\n")
        sys.stdout.flush()
    peer.session.close()


if __name__ == "__main__":
    main()
