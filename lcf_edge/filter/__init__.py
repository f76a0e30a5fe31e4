"""The Line-Circle filter (Tafrishi & Kandjani 2017): pure, bounded, whole-array.

One step, in reading order (``line_circle_filter``):

``inputs``          what a step takes: the frame's corners and the vehicle's motion since the last frame
``tables``          what is kept between steps: edges (E_n, E_r), circles (C_n, C_r), ψ; preallocated
``flow``            where what stands still goes: focus of expansion, flow lines, derotation, key frames
``line_expert``     corners inside ψ are omitted, the rest is grouped by λ
``matching``        corners and predicted edges find each other, one to one
``edge_expert``     the five classes λ*, trust, and the updates of L, V, BL, β, DL
``rebel_detection`` α: which edges break the flow over three key frames
``circle_expert``   edges become circles
``feedback``        trusted normal circles become ψ; circles become λ
"""

from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_circle_filter import LineCircleFilter

__all__ = ["Corners", "LineCircleFilter", "Motion"]
