"""A siege: the daemon, its gate and its page under attack by all at once, on loopback, for a bounded time.

``attacks`` are who comes; ``place`` is what they come to; ``figures`` says what must hold meanwhile.
"""
