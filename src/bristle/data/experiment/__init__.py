"""The experiment file: its schema, how it is read, and how a draft of it is made."""
