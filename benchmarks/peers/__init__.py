"""Other methods for the filter's task, each tuned to do as well as it can.

Each peer is a class with ``process(image, motion)`` that returns rebel circles. They differ in how they measure motion
in the image, and share all that follows:

``peer``             the interface of a peer
``ego``              rotation and displacement of the camera since each of the last images; its heading
``residual``         points that break the flow of the static scene, and points on a collision course
``clustering``       groups points into circles with trust
``backdrop``         an earlier image, warped as the ground and distant points move
``lucas_kanade``     FAST corners and pyramidal Lucas-Kanade
``orb``              ORB features matched with those of earlier images
``frame_difference`` differences of images registered by rotation and ground plane
``dense_flow``       DIS optical flow
``landmark_map``     the paper's own comparison: a map of all FAST-9 landmarks; for sizes only
"""

from benchmarks.peers.dense_flow import DenseFlow
from benchmarks.peers.frame_difference import FrameDifference
from benchmarks.peers.landmark_map import LandmarkMap
from benchmarks.peers.lucas_kanade import LucasKanade
from benchmarks.peers.orb import Orb
from benchmarks.peers.peer import Peer

__all__ = ["PEERS", "DenseFlow", "FrameDifference", "LandmarkMap", "LucasKanade", "Orb", "Peer"]

PEERS: dict[str, type[Peer]] = {
    "lucas_kanade": LucasKanade,
    "orb": Orb,
    "dense_flow": DenseFlow,
    "frame_difference": FrameDifference,
}
"""The peers that find circles, by name."""
