"""The search for grasps and for the motion that closes them."""
