"""An interactive page of the model."""
