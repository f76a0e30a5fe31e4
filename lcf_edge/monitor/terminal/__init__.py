"""The table in a terminal: ``screen`` makes it from a snapshot, ``terminal`` reads keys and restores the terminal.

``player_keys`` are those of a recording.
"""
