"""Hardware in the loop: the installed daemon on a real kernel, in a virtual machine.

`make hil`, or ``python -m pytest hil_mocks/vm`` (as root). ``image`` makes a Debian system from packages and installs
the project into it by `make install`; ``machine`` boots it in qemu and runs commands in it; ``guest`` has what runs
inside; ``daemon`` is the service as the scenarios see it; ``scenarios`` are the tests, one machine for all of them.
"""
