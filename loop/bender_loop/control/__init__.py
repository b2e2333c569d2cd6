"""The closed loop in discrete time: PID block, references, sampling, the plant protocol, figures of a step.

| module | holds |
|---|---|
| `following_loop` | the closed loop with a model-following controller |
| `inverse` | the command under which a model reads what is wanted, found by trying |
| `learning` | iterative learning: what repeats is corrected from pass to pass |
| `model_following` | the model says the command, the PID block answers for what it got wrong |
| `shaper` | a set-point that jumps becomes one of bounded rate and curvature |
| `closed_loop` | the closed loop in discrete time: camera, PID block, command, plant |
| `metrics` | figures of a step response |
| `pid` | the PID block: one function that the tuner, the controller FMU and the bench runner all call |
| `plant` | what a loop needs to know of a plant: one voltage in, one displacement out |
| `references` | setpoints over time, each an equation in its own frozen settings |
| `sampling` | how a camera sees the plant: rate, latency, exposure, noise, quantisation |
| `trace` | what a closed-loop run leaves behind |
"""
