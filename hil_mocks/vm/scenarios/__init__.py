"""What the daemon promises, on a real kernel: each scenario starts the service that it needs."""
