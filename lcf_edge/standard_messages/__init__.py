"""The scene in standard messages, for Foxglove, RViz, Nav2 and every ROS 2 node.

Each file has one message as a pure function, from a scene to its CDR. Conventions are those of ROS: metres, x ahead, y
left and z up on the vehicle (REP-103), frames by their usual names (REP-105), and in the camera's optical frame x
right, y down and z ahead. Objects of unknown range have no position, and are left out of messages with positions.
"""
