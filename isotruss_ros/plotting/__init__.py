"""Drawings of robots, grasps and fits with Matplotlib."""
