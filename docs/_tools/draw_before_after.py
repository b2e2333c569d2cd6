"""The picture of README: what the model leaves of the sample record, the effect that is named, what is left with it.

`make picture` runs it; the diagnosis is that of `bender diagnose examples/record.csv`.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import piezo_bender as pb
from bender_report.palette import light

ROOT = Path(__file__).parents[2]
RECORD, PICTURE = ROOT / "examples" / "record.csv", ROOT / "docs" / "before-after.png"


def main() -> None:
    """Diagnose the sample record and draw what is left before and after."""
    found = pb.diagnose(RECORD)
    with tempfile.TemporaryDirectory() as folder:
        found.save(folder)
        before, after = pb.compare(RECORD), pb.compare(RECORD, Path(folder) / "model.toml")
    measured_um = before.record.displacement_um
    panels = [
        ("before (gain and offset recalibrated)", before.recalibrated_um, light("without")),
        ("after", after.simulated_um, light("with")),
    ]
    figure = Figure(figsize=(9.0, 3.4), dpi=150, layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=(5.0, 1.6, 5.0), sharey=False)
    limit_um = 1.08 * float(np.nanmax(np.abs(measured_um - before.recalibrated_um)))
    for panel, (title, simulated_um, colour) in zip((axes[0], axes[2]), panels, strict=True):
        left_um = measured_um - simulated_um
        panel.plot(before.axis, left_um, ".", ms=2.2, color=colour)
        panel.set(ylim=(-limit_um, limit_um), xlabel=before.axis_label)
        rms_um = float(np.sqrt(np.nanmean(left_um**2)))
        panel.set_title(f"{title}: {rms_um:.2g} µm rms", fontsize=10, loc="left")
        panel.axhline(0.0, color="0.8", lw=0.8, zorder=0)
        panel.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("measured minus simulated (µm)")
    axes[1].axis("off")
    names = "\n+ ".join(x["title"].lower() for x in found.to_dict()["effects"])
    axes[1].annotate("", (1.0, 0.5), (0.0, 0.5), xycoords="axes fraction", arrowprops={"arrowstyle": "-|>", "lw": 1.6})
    axes[1].text(0.5, 0.56, f"missing:\n{names}", ha="center", va="bottom", transform=axes[1].transAxes, fontsize=11)
    figure.savefig(PICTURE)


if __name__ == "__main__":
    main()
