"""Hide a lag in a simulated bench, take a noisy record of it, and let the diagnosis say what the model lacks."""

import numpy as np

import piezo_bender as pb

rng = np.random.default_rng(5)
time_s = np.arange(900) / 30.0
voltage_V = np.repeat(rng.uniform(0.0, 50.0, 60), 15)
bench = pb.load_model("paper").with_block("source_resistance", time_constant_s=0.05)
displacement_um = bench.simulate(time_s, voltage_V) + 0.06 * rng.standard_normal(time_s.size)

found = pb.diagnose({"time_s": time_s, "voltage_V": voltage_V, "displacement_um": displacement_um}, "paper")
print(f"{found.verdict}: {found.reason}")
for effect in found.added:
    for x in effect.numbers:
        low, high = x.interval or (x.value, x.value)
        print(f"  {effect.id}: {x.name} = {x.value:.4g} {x.unit}, 95 % between {low:.4g} and {high:.4g}")
