"""Models of the plant for tuning: linear, sampled, reduced; margins, ensembles, Monte Carlo."""
