"""The diagnostics for Prometheus: ``text`` formats them, ``endpoint`` serves them, ``sink`` keeps them up to date."""
