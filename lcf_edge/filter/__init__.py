"""The Line-Circle filter (Tafrishi & Kandjani 2017): pure, bounded, one edge at a time.

Modules with a ``.pxd`` beside them are compiled; uncompiled they give the same bytes (``docs/filter.md``). The modules
of one step, in the order in which ``line_circle_filter`` calls them:

``inputs``             input of a step: the frame's corners and the vehicle's motion since the last frame
``tables``             state kept between steps: edges (E_n, E_r, α), circles (C_n, C_r), ψ; preallocated
``columns``            the same as typed memory; ``edge_rows`` moves whole rows, ``memory`` allocates
``settings``           the configuration's constants for the loops
``flow``               directions, flow lines, the pinhole camera, rotations as homographies
``key_frames``         rotation and displacement of the vehicle since each key frame
``heading``            direction of travel in camera axes: the learnt mounting, and how the camera shakes
``situation``          the vehicle in this frame: focus of expansion, dimensions, motion
``path``               the vehicle's path over the ground: lateral miss of a point, and distance along the path to it
``image_plane``        projection from the ideal pinhole through the lens
``least_squares``      with a few unknowns
``rounding``           to integers, as C does; ``lengths`` of offsets
``derotation``         step 0: takes the camera's rotation out of all stored positions
``rolling_shutter``    how long it reads an image, from edges off their flow lines while the camera turns
``line_expert``        corners inside ψ are omitted, the rest is grouped by λ
``matching``           corners and predicted edges find each other, one to one
``leaps``              where whole parts of the image lost their corners: the shift that they share
``edge_equations``     the Circle expert's equations for edges: prediction, the five classes λ*, updates, trust
``edge_expert``        applies them to the table
``baselines``          the flow that the displacement since each key frame implies for this image
``flow_fit``           errors of the camera's rotation and of O, fitted to all edges together
``rest``               whether the vehicle is stationary, from the image
``driving``            whether it drives, from the image
``glossy_floor``       whether the floor mirrors
``ground_speed``       the vehicle's speed, from the flow of the ground
``rebel_detection``    the equations that find what breaks the flow over a chain of key positions
``alpha``              applies them: chains become rebel edges, rebels that obey the flow return to E_n
``circles``            what normal and rebel circles share
``normal_circles``     C_n from E_n
``rebel_groups``       rebels that move alike, and which groups of them make no circle
``rebel_circles``      C_r from E_r, with cause and time to contact
``group_motion``       how edges that go together move: mean velocity and rate of expansion
``patches``            image patches near the path, tracked for seconds
``patch_circles``      C_r from patches that grow
``block_matching``     the downscaled images, and how pieces of them are compared
``coarse_motion``      pieces of the downscaled image that move independently, or are met soon
``body_ahead``         C_r from pieces that are met at one time: one large body straight ahead
``coarse_circles``     C_r from pieces that move together
``turmoil``            C_r where corners come and go and none can be tracked
``range_belief``       an object's range and motion over ground, from its motion in the image
``square_expert``      S: circles of one thing are an object, whose edges measure its motion
``object_prediction``  where objects go, and how long one is kept that no edge shows
``object_belief``      range, velocity, contact and class of an object
``object_circles``     S corrects C_r
``feedback``           trusted normal circles become ψ, and ψ gives way to rebels
"""

from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_circle_filter import LineCircleFilter

__all__ = ["Corners", "LineCircleFilter", "Motion"]
