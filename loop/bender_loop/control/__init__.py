"""The closed loop in discrete time: PID block, references, sampling, the plant protocol, figures of a step.

| module | holds |
|---|---|
| `closed_loop` | the closed loop in discrete time: camera, PID block, command, plant |
| `metrics` | figures of a step response |
| `pid` | the PID block: one function that the tuner, the controller FMU and the bench runner all call |
| `plant` | what a loop needs to know of a plant: one voltage in, one displacement out |
| `references` | setpoints over time, each an equation in its own frozen settings |
| `sampling` | how a camera sees the plant: rate, latency, exposure, noise, quantisation |
| `trace` | what a closed-loop run leaves behind |
"""
