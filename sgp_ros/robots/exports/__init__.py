"""Robots written for other programs: MJCF, SDF, Isaac Lab, ros2_control, URDF, JSON."""
