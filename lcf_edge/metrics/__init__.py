"""The diagnostics for Prometheus: ``text`` writes them in its format, ``endpoint`` serves that, ``sink`` keeps them."""
