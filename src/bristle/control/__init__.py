"""The controller, the compensator and the closed loop."""
