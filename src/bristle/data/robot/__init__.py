"""Robots: what a URDF says, what its links ask of each joint, and the file of a robot with all its joints."""
