"""Records in, the first model of them and its plant out; whatever fails in between is one sentence."""

from collections.abc import Sequence

from bender_identify.first_model.choice import FirstModel, Tell, first_model
from bender_identify.first_model.fit import CANNOT_BE
from bender_identify.first_model.report import learned_model
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import Experiment
from bender_loop.errors import InputError
from bender_loop.tables.quantities import Quantities
from bender_plant.model import Model


def learn(
    experiments: Sequence[Experiment],
    name: str,
    quantities: Quantities,
    tell: Tell | None = None,
    only: Structure | None = None,
) -> tuple[FirstModel, Model]:
    """Return the first model that the records support, and the plant that it makes.

    Args:
        experiments: the records.
        name: of the plant.
        quantities: of the records.
        tell: is told what is being fitted.
        only: take this structure, with a delay where the records support one.

    Raises:
        InputError: no structure goes together with the records.
    """
    try:
        found = first_model(experiments, tell, only)
        return found, learned_model(found, name, quantities)
    except CANNOT_BE as error:
        raise InputError(f"no first model could be fitted: {error}; check the units of the columns") from error
