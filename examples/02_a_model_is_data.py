"""Take the built-in model, give the beam a thicker substrate and the material some creep, and write its FMU."""

import tempfile
from pathlib import Path

import tomli_w

from bender_export.build import build_plant_fmu
from bender_plant.composite_beam import natural_frequency_Hz
from bender_plant.model import load_model

paper = load_model("paper")
stiffer = paper.with_values({"beam.layer[1].thickness": 75e-6})
creeping = stiffer.with_block("creep", gains=(0.05, 0.05), time_constants_s=(1.0, 10.0))
for model in (paper, creeping):
    assert model.beam is not None
    print(f"{natural_frequency_Hz(model.beam, 1):7.2f} Hz  {[block.id for block in model.blocks]}")

with tempfile.TemporaryDirectory() as folder:
    Path(folder, "model.toml").write_text(tomli_w.dumps(creeping.to_table()), encoding="utf-8")
    fmu = build_plant_fmu(load_model(Path(folder, "model.toml")), Path(folder, "creeping.fmu"))
    print(f"{fmu.name}: {fmu.stat().st_size // 1024} kB")
