"""What an identification writes: the model file with its report, picture and figures."""

from dataclasses import replace

import tomli_w

from bender_identify.identification_result import Identification
from bender_identify.report.figures import figures
from bender_identify.report.loops import draw_loops
from bender_identify.report.page import page
from bender_identify.settings import COMPANIONS
from bender_loop.shell.files import result_text
from bender_plant.model import Model


def written_model(outcome: Identification, name: str) -> Model:
    """Return the model that the model file holds, with a name and a word on where it comes from."""
    names = ", ".join(x.name for x in outcome.experiments)
    kept = outcome.written.candidate
    return replace(kept.model, name=name, description=f"Learned from {names}: {kept.title}")


def contents(outcome: Identification, name: str) -> dict[str, str | bytes]:
    """Return the files of an identification, by their names; the model file is the last."""
    model, picture = f"{name}.toml", draw_loops(outcome)
    return {
        f"{name}{COMPANIONS['report']}": page(outcome, picture, model),
        f"{name}{COMPANIONS['loops']}": picture,
        f"{name}{COMPANIONS['figures']}": result_text(figures(outcome)),
        model: tomli_w.dumps(written_model(outcome, name).to_table()),
    }
