"""The search for grasps on all cores, and its command line; no ROS."""
