"""The virtual bench, the paper's numbers, and a known joint in its loop."""
