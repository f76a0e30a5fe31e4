"""The smallest subscriber: a line for each object of each scene.

python examples/subscriber.py tcp/127.0.0.1:7447
"""

import sys

from lcf_edge.client import ObjectClass, scenes


def main(endpoint: str) -> None:
    """Print until interrupted."""
    for scene in scenes(endpoint):
        for thing in scene.objects:
            name = ObjectClass(thing["class_id"]).name.lower()
            print(f"{scene.seq}: {name}, contact in {thing['ttc']:.1f} ± {thing['ttc_sigma']:.1f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
