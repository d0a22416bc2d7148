"""The direct stiffness model of the robot: equations (1), (2) and (4)."""
