"""Views of a running daemon: ``live`` receives its data, ``terminal`` and ``web`` show them.

``replay`` plays a recording in place of the daemon.

``terminal`` is the table of ``lcf-edge watch``, ``web`` the page of ``lcf-edge view``, ``foxglove`` passes it on to the
Foxglove app.
"""
