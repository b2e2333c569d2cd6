"""Models of the plant for tuning: linear, sampled, reduced; margins, ensembles, Monte Carlo.

| module | holds |
|---|---|
| `disturbances` | what a loop makes of measurement noise and of a load, on the sampled linear model |
| `ensemble` | the plants that a tuning must hold for |
| `linear_model` | small-signal model of any plant about an operating point, from steps of the plant itself |
| `linearised_fmu` | A, B, C, D of anybody's FMU at an operating point |
| `loop_transfer` | the sampled open loop L = C z^-d G |
| `margins` | how far a loop is from instability: gain, phase and delay margin, and the peaks of S and T |
| `monte_carlo` | one set of gains on many plants drawn at random |
| `python_control` | plant and controller as systems of python-control |
| `reduced_model` | a gain, one lag and a delay that stand for a plant in a tuning rule |
| `sampled_model` | a linear plant as the controller's samples see it |
| `scaled_plant` | any plant with its reading multiplied by a factor |
| `sensitivities` | the four sensitivity functions of a loop |
| `state_space` | a sampled model as matrices of few states |
| `ultimate` | the ultimate point |
"""
