"""The picture of the page on evidence: what each block of the sample record is for, and what an effect leaves in it.

`make picture` runs it; the diagnosis is that of `bender diagnose examples/record.csv`.
"""

import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import piezo_bender as pb
from bender_inference.records.roles import blocks_of, held_out_and_reported
from bender_report.palette import light

ROOT = Path(__file__).parents[2]
RECORD, PICTURE = ROOT / "examples" / "record.csv", ROOT / "docs" / "evidence.png"
ROLES = {"training: fitted": "0.92", "selection: chooses": "#f2d9a6", "reported: used once": "#b5d3ea"}


def main() -> None:
    """Diagnose the sample record and draw its blocks, and the rms of the residual in each of them."""
    record = pb.load_record(RECORD)
    with tempfile.TemporaryDirectory() as folder:
        pb.diagnose(record).save(folder)
        before, after = pb.compare(record), pb.compare(record, Path(folder) / "model.toml")
    read = np.isfinite(record.displacement_um)
    number = blocks_of(read)
    held_out, reported = held_out_and_reported(read, record.voltage_V)
    rows = [read & (number == block) for block in np.unique(number[read])]
    colours = [tuple(ROLES.values())[int(held_out[row].any()) + int(reported[row].any())] for row in rows]
    edges = [*(record.time_s[row][0] for row in rows), record.time_s[-1]]
    figure = Figure(figsize=(9.0, 4.2), dpi=150, layout="constrained")
    command, error = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.3))
    for panel in (command, error):
        for (begin, end), colour in zip(pairwise(edges), colours, strict=True):
            panel.axvspan(begin, end, color=colour, lw=0)
        panel.spines[["top", "right"]].set_visible(False)
    command.step(record.time_s, record.voltage_V, where="post", color="0.3", lw=0.8)
    command.set(ylabel="command (V)", xlim=(edges[0], edges[-1]))
    for label, simulated_um, kind in (
        ("gain and offset alone", before.recalibrated_um, "without"),
        ("with creep", after.simulated_um, "with"),
    ):
        left_um = record.displacement_um - simulated_um
        rms_um = [float(np.sqrt(np.mean(left_um[row] ** 2))) for row in rows]
        error.stairs(rms_um, edges, color=light(kind), lw=2.0, baseline=None, label=label)
    error.set(yscale="log", ylim=(0.03, 2.0), ylabel="residual in the block\n(µm rms)", xlabel="time (s)")
    error.set_yticks([0.05, 0.1, 0.2, 0.5, 1.0], ["0.05", "0.1", "0.2", "0.5", "1"])
    error.minorticks_off()
    error.legend(loc="upper right", frameon=False, fontsize=9, ncols=2)
    patches = [Patch(color=colour, label=role) for role, colour in ROLES.items()]
    figure.legend(handles=patches, loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    figure.savefig(PICTURE)


if __name__ == "__main__":
    main()
