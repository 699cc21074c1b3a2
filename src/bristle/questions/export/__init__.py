"""What an identified joint is handed over as: code for a controller, models for simulators, and what is lost by it."""
