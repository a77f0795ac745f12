"""Rigid bodies: URDF files, trees of joints, their dynamics, bodies that can exist."""
