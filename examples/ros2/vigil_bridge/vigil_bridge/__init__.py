"""Sends a robot's ROS 2 messages to Vigil as frames; publishes Vigil's verdicts, and obeys them."""
