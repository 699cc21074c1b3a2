"""Export of an identified joint to controllers, simulators and documents."""
