"""From the twist of a grasped object to roller velocities: equations (11), (14) to (20)."""
