"""What is tuned: settings, search space, experiment, objectives, and the methods at work."""
