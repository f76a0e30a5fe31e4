"""What people look at a running daemon with: ``live`` follows it, ``terminal`` and ``web`` show that.

``replay`` plays a recording in place of the daemon.

``terminal`` is the table of ``lcf-edge watch``, ``web`` the page of ``lcf-edge view``, ``foxglove`` passes it on to the
Foxglove app.
"""
