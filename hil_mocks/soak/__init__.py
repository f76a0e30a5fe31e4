"""The soak: the daemon for hours at full speed, with random faults, and what that cost in memory and images.

`python -m hil_mocks.soak --frames 200000` or `--minutes 60`. ``__main__`` starts the daemon, ends it now and then, and
reports; ``daemon`` is `lcf-edge run` with the devices of ``stand_ins``, which deliver as fast as images are taken and
go wrong at random; ``figures`` has what is reckoned from the daemon's own diagnostics.
"""
