"""What acts: the PID controller and the closed loop."""
