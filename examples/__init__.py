"""Programs to copy: a planner that slows down and stops for what it will meet (``planner``)."""
