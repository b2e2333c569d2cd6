"""What measures the project itself: reproduction of the paper, demonstration, benchmarks."""
