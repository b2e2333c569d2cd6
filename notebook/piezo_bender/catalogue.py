"""The catalogue of effects that a measurement may show and a model may lack."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_effects.catalogue import EFFECTS, Effect
from bender_loop.errors import InputError
from piezo_bender.shared import axes_or_new, frame_of, html_table, name_arguments_in_errors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, repr=False)
class Catalogue:
    """Effects of the catalogue: all of them, or one."""

    effects: tuple[Effect, ...]

    @property
    def only(self) -> Effect:
        """The effect that was asked for.

        Raises:
            InputError: there is more than one.
        """
        if len(self.effects) != 1:
            raise InputError(f"effect: found {len(self.effects)}, expected one; ask for one as effects('creep')")
        return self.effects[0]

    def __len__(self) -> int:
        return len(self.effects)

    def __getitem__(self, effect_id: str) -> "Catalogue":
        return effects(effect_id)

    def picture(self) -> bytes:
        """Return what the one effect leaves in the residual, as PNG.

        Raises:
            InputError: matplotlib is not installed.
        """
        from bender_discrepancy.report.signature.drives import simulate
        from bender_discrepancy.report.signature.picture import draw_signature
        from bender_report.drawing import require_drawing

        require_drawing("picture")
        return draw_signature(self.only, simulate(self.only))

    def save(self, folder: Path | str) -> Path:
        """Write effects.json, and signature.png of a single effect where it can be drawn; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        import json

        from bender_loop.shell.files import prepare_directory, write_atomically
        from bender_report.drawing import can_draw

        picture = self.picture() if len(self.effects) == 1 and can_draw() else None
        out = prepare_directory(Path(folder))
        text = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
        write_atomically(out / "effects.json", text + "\n")
        if picture is not None:
            write_atomically(out / "signature.png", picture)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw what the one effect leaves in the residual over time, or all effects by their stage; return the axes."""
        if len(self.effects) == 1:
            return self._plot_residual(axes)
        drawn = axes_or_new(axes, 10.0, 4.0)
        stages = list(dict.fromkeys(x.stage for x in self.effects))
        for column, stage in enumerate(stages):
            for row, effect in enumerate(x for x in self.effects if x.stage == stage):
                drawn.text(column, -row, effect.id, ha="center", va="center", fontsize=9)
        drawn.set(xlim=(-0.5, len(stages) - 0.5), ylim=(-7.0, 0.7), xticks=range(len(stages)), xticklabels=stages)
        drawn.set_yticks([])
        return drawn

    def _plot_residual(self, axes: "Axes | None") -> "Axes":
        from bender_discrepancy.report.signature.drives import simulate
        from bender_report.palette import light

        left = simulate(self.only)
        drawn = axes_or_new(axes)
        drawn.plot(left.drive.time_s, left.residual_um, lw=1.0, color=light("without"))
        title = f"{self.only.id}: what a model without it leaves, under {left.drive.words}"
        drawn.set(xlabel="time (s)", ylabel="residual (µm)", title=title)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the effects by their ids, with bounds, typical sizes and words."""
        return {x.id: entry(x) for x in self.effects}

    def to_frame(self) -> "DataFrame":
        """Return one row for each parameter (needs pandas)."""
        rows = [(x, name, known) for x in self.effects for name, known in x.parameters.items()]
        return frame_of(
            {
                "effect": [x.id for x, _, _ in rows],
                "stage": [x.stage for x, _, _ in rows],
                "parameter": [name for _, name, _ in rows],
                "unit": [known.unit for _, _, known in rows],
                "low": [known.low for _, _, known in rows],
                "high": [known.high for _, _, known in rows],
            }
        )

    def __repr__(self) -> str:
        return f"<Catalogue of {len(self)}: {', '.join(x.id for x in self.effects)}>"

    def _repr_html_(self) -> str:
        rows = [(x.id, x.stage, x.summary) for x in self.effects]
        return html_table("effects that a model may lack", ("effect", "stage", "what it is"), rows)


def entry(effect: Effect) -> dict[str, Any]:
    """Return one effect as JSON has it."""
    parameters = {
        name: {"unit": known.unit, "low": known.low, "high": known.high, "text": known.text}
        for name, known in effect.parameters.items()
    }
    words = ("id", "title", "stage", "summary", "signature", "confusables", "separation", "excitation", "typical")
    told = (*words, "covered", "unusual", "page", "relative", "example", "drive", "view")
    return {name: getattr(effect, name) for name in told} | {"block": effect.block.id, "parameters": parameters}


@name_arguments_in_errors
def effects(effect_id: str | None = None) -> Catalogue:
    """Return the catalogue of effects, or one of them.

    Raises:
        InputError: there is no such effect; those nearest to it are named.
    """
    if effect_id is None:
        return Catalogue(tuple(EFFECTS.values()))
    if effect_id not in EFFECTS:
        near = _near(effect_id, list(EFFECTS))
        raise InputError(f"effect: found {effect_id!r}, expected {near}; list them: bender effects")
    return Catalogue((EFFECTS[effect_id],))


def _near(asked: str, known: list[str]) -> str:
    import difflib

    wanted = asked.lower().replace("-", "_")
    near = [name for name in known if wanted and (wanted in name or name in wanted)]
    near += [name for name in difflib.get_close_matches(wanted, known, n=3, cutoff=0.5) if name not in near]
    return " or ".join(repr(name) for name in near[:3]) if near else f"one of {', '.join(known)}"
