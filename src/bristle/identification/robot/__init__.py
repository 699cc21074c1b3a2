"""The joints of a robot, with the torque of its links."""
