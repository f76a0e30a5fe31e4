"""Measurements: `score` compares results with the truth of rendered drives."""
