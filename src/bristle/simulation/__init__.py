"""The virtual bench, the paper's joints, and a joint in its loop."""
