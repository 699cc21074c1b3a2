"""The virtual bench, the paper's joints, a joint in its loop, and what measurements yet to come keep within and tell."""
