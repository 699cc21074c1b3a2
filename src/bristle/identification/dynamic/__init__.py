"""All parameters from a motion, with those of the other experiments as priors."""
