"""What a robot is: the robot file, the presets, the topology, objects."""
