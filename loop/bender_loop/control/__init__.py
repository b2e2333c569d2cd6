"""The closed loop in discrete time: PID block, references, sampling, the plant protocol, figures of a step."""
