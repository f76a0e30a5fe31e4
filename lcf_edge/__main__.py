"""``python -m lcf_edge`` is ``lcf-edge``."""

import sys

from lcf_edge.cli.command_line import main

if __name__ == "__main__":
    sys.exit(main())
