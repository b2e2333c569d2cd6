"""Hide a lag in a simulated bench, take a noisy record of it, and let the workflow say what the model lacks."""

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import Record
from bender_plant.model import load_model

rng = np.random.default_rng(5)
time = np.arange(900) / 30.0
voltage = np.repeat(rng.uniform(0.0, 50.0, 60), 15)
bench = load_model("paper").with_block("source_resistance", time_constant_s=0.05)
displacement = Simulator(Drive.of_rows(time, voltage)).run(bench).reading_um + 0.06 * rng.standard_normal(time.size)

diagnosis = diagnose(load_model("paper"), [Record(time, voltage, displacement)])
print(f"{diagnosis.verdict.word}: {diagnosis.verdict.reason}")
for part in diagnosis.best.hypothesis.parts:
    named = ", ".join(f"{free.name} = {value:.4g}" for free, value in zip(part.form.free, part.values, strict=True))
    print(f"  {part.form.effect} ({named})")
