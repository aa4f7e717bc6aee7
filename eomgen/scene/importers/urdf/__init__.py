"""URDF, the Unified Robot Description Format of ROS, as a scene.

http://wiki.ros.org/urdf/XML/link and .../joint say what the elements are.
"""
