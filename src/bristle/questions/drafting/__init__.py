"""Drafts of experiment files."""
