"""From data to parameters. One question is one file; stages meet by passing results."""
