"""Contact, force closure and equilibrium of a grasped object: equations (5) to (10)."""
