"""What a user asks: each folder owns its computation, tables, figures, words and templates, and imports no other."""
