"""What was measured: records, their reading, the experiment file, constant-velocity segments."""
