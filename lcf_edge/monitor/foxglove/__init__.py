"""``lcf-edge foxglove``: the output of a running daemon, for the Foxglove app (``relay``)."""
