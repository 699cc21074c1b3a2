"""The joints of a robot: whether its log and its URDF belong together, torque constants, and each joint with what the links ask of it."""
