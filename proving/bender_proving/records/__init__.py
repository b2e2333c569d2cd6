"""What is played to a hidden bench and read from it."""
