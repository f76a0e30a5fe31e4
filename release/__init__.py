"""What is released: wheels for two processors, built for both on either, and tried where nothing can be compiled."""
