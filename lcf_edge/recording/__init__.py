"""Recordings: written (``write``), read (``read``), and played as if they were devices (``playback``)."""
