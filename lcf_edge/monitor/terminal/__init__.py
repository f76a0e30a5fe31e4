"""The table in a terminal: ``screen`` makes it from what is known, ``terminal`` has the keys and the way back.

``player_keys`` are those of a recording.
"""
