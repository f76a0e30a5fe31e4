"""``lcf-edge foxglove``: what a running daemon sees, for the Foxglove app (``relay``)."""
