"""The soak test: the daemon for hours at full speed, with random faults; measures memory and lost images.

`python -m hil_mocks.soak --frames 200000` or `--minutes 60`. ``__main__`` starts the daemon, ends it now and then, and
reports; ``daemon`` is `lcf-edge run` with the devices of ``stand_ins``, which deliver as fast as images are taken and
fail at random; ``figures`` evaluates the daemon's own diagnostics.
"""
