"""Loops that command the robot: inputs, twist servo, path tracking, roller trajectories."""
