"""The live view in a browser; it reads messages by their fields and imports no ROS."""
