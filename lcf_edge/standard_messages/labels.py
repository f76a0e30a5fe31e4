"""Short labels for objects and circles, and their colours."""

import numpy as np

from lcf_edge.messages import Cause, ObjectClass

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity: 0 to 1."""

GREEN: Colour = (0.27, 0.84, 0.27, 1.0)
RED: Colour = (1.0, 0.2, 0.2, 1.0)
YELLOW: Colour = (1.0, 0.88, 0.0, 1.0)
ORANGE: Colour = (1.0, 0.63, 0.16, 1.0)
LIGHT_BLUE: Colour = (0.43, 0.84, 1.0, 1.0)
SHADE: Colour = (0.0, 0.0, 0.0, 0.6)  # behind text
NOTHING: Colour = (0.0, 0.0, 0.0, 0.0)

PROBABLY = 0.5
"""An object with this probability or more will probably be met."""


def colour_of(thing: np.void) -> Colour:
    """Return orange for what will probably be met, else light blue."""
    return ORANGE if thing["probability"] >= PROBABLY else LIGHT_BLUE


def class_name(thing: np.void) -> str:
    """``crossing``, ``cutting_in``, …"""
    return ObjectClass(thing["class_id"]).name.lower()


def object_label(thing: np.void) -> str:
    """Return class, time to contact and range, as far as known: ``crossing 2.1 ±0.2 s 3.2 m``."""
    name = "object" if thing["class_id"] == ObjectClass.UNKNOWN else class_name(thing).replace("_", " ")
    spread = f" ±{thing['ttc_sigma']:.1f}" if np.isfinite(thing["ttc_sigma"]) else ""
    contact = f" {thing['ttc']:.1f}{spread} s" if np.isfinite(thing["ttc"]) else ""
    return name + contact + (f" {thing['range']:.1f} m" if np.isfinite(thing["range"]) else "")


def circle_label(circle: np.void) -> str:
    """Return cause and time to contact: ``incoming 1.3 s``."""
    cause = Cause(circle["cause"])
    name = "rebel" if cause is Cause.NONE else cause.name.lower()
    return f"{name} {circle['ttc']:.1f} s" if np.isfinite(circle["ttc"]) else name
