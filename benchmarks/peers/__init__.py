"""Other ways to find what the filter finds, each tuned as if it were to win.

Each peer is a class with ``process(image, motion)`` that returns rebel circles. They differ in how they
find out what moves where in the image, and share all that follows:

``peer``             what a peer is given and what it returns
``ego``              how the camera turned and drove since each of the last images; where it is heading
``residual``         which points break the flow of what stands still, and which will be met
``clustering``       points that go together become circles with trust
``backdrop``         an earlier image, moved as the ground and what is far away move
``lucas_kanade``     FAST corners and pyramidal Lucas-Kanade
``orb``              ORB features matched with those of earlier images
``frame_difference`` images laid over each other by rotation and ground plane
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
