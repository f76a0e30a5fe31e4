"""A siege: the daemon, its gate and its page under all attacks at once, on loopback, for a bounded time.

``attacks`` are the attackers; ``place`` is what they attack; ``__main__`` runs it and checks what must hold meanwhile.
"""
