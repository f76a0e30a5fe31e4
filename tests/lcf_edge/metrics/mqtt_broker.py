"""A broker of an independent implementation (``amqtt``): ``python mqtt_broker.py PORT``; says when it listens."""

import asyncio
import logging
import sys

from amqtt.broker import Broker


async def main() -> None:
    logging.disable()
    listener = {"type": "tcp", "bind": f"127.0.0.1:{sys.argv[1]}"}
    plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    broker = Broker({"listeners": {"default": listener}, "plugins": plugins})
    await broker.start()
    sys.stdout.write("listens\n")
    sys.stdout.flush()
    await asyncio.Event().wait()


asyncio.run(main())
