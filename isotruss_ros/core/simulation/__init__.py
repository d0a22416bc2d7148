"""The simulated robot and the object that it grasps."""
