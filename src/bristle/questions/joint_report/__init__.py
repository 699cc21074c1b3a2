"""The identification report of one or more joints."""
