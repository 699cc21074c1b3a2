"""Which parameters matter, along a motion and over their intervals."""
