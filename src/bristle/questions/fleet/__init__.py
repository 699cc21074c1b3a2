"""Friction of many joints over many sessions: which joints changed, and which units differ from their type."""
