"""The Line-Circle filter (Tafrishi & Kandjani 2017): pure, bounded, one edge at a time.

Modules with a ``.pxd`` beside them are compiled; uncompiled they give the same bytes (``docs/filter.md``). One step,
in reading order (``line_circle_filter`` calls them in this order):

``inputs``           what a step takes: the frame's corners and the vehicle's motion since the last frame
``tables``           what is kept between steps: edges (E_n, E_r, α), circles (C_n, C_r), ψ; preallocated
``columns``          the same, as the loops see them; ``edge_rows`` moves whole rows, ``memory`` makes room
``settings``         the configuration's constants, as the loops take them
``flow``             directions, flow lines, the ideal camera, rotations as homographies
``key_frames``       how the vehicle has turned and moved since each key frame
``heading``          where it heads in the camera's axes: the mounting, learnt, and how the camera shakes
``situation``        the vehicle at this instant: where it heads in the image, what it is, how it moves
``path``             its path over the ground: how far beside it something lies, and how long the way to it is
``image_plane``      where a position of the ideal pinhole is seen through the lens
``least_squares``    of a few unknowns
``rounding``         to whole numbers, as C does; ``lengths`` of offsets
``derotation``       step 0: the camera's rotation is taken out of all that is stored
``line_expert``      corners inside ψ are omitted, the rest is grouped by λ
``matching``         corners and predicted edges find each other, one to one
``leaps``            where whole parts of the image lost their corners: a leap that they share
``edge_equations``   the Circle expert's equations for edges: prediction, the five classes λ*, updates, trust
``edge_expert``      applies them to the table
``baselines``        what the displacement since each key frame implies for this image
``flow_fit``         what all edges together tell of the camera: errors of its rotation, and of O
``rest``             whether the vehicle stands, as the image shows
``driving``          whether it drives
``ground_speed``     how fast the vehicle is, as the ground tells
``rebel_detection``  what breaks the flow over a chain of key positions, as equations
``alpha``            applies them: chains become rebel edges, rebels that obey go home
``circles``          what normal and rebel circles share
``normal_circles``   C_n from E_n
``rebel_circles``    C_r from E_r, with cause and time to contact
``group_motion``     how edges that go together move: mean velocity and rate of expansion
``patches``          pieces of the image near the path, followed for seconds
``patch_circles``    C_r from patches that grow
``coarse_motion``    pieces of the image in small that move by themselves
``coarse_circles``   C_r from those that go together
``turmoil``          C_r where corners come and go and none can be followed
``range_belief``     what an object's motion says about its range and its motion over ground
``square_expert``    S: circles that belong to one thing are an object
``object_circles``   what S knows back to C_r
``feedback``         trusted normal circles become ψ, and ψ gives way
"""

from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_circle_filter import LineCircleFilter

__all__ = ["Corners", "LineCircleFilter", "Motion"]
