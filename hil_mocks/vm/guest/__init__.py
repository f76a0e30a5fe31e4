"""What runs inside the machine: ``agent`` carries out commands, ``bno055`` lets registers live."""
