"""Many joints over many sessions: the joints that changed, and the units that differ from their type."""
