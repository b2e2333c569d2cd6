"""What a tuning leaves: gains file, tuning file, summary, robustness report."""
