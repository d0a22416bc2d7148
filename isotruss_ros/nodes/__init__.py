"""The ROS nodes: messages in, messages out; the mathematics is in `isotruss_ros.core`."""
