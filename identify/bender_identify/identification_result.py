"""What an identification comes to: its candidates, their scores, and the one that is written."""

from dataclasses import dataclass

from bender_identify.fitting.candidate import Candidate
from bender_identify.fitting.identifiability import Identifiability
from bender_identify.fitting.resimulation import Score
from bender_identify.records.experiment import Experiment
from bender_identify.records.extrapolation import Unseen
from bender_identify.regression.equation_search import Learned


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One candidate and what it is worth.

    Attributes:
        candidate: the model, fitted to the rows that fits may see.
        fitted: its score there, re-simulated.
        held_out: its score on held-out rows, re-simulated.
        remanence_um: what stays at 0 V after the voltage was up and down again.
        remanent: whether that counts as remanence.
    """

    candidate: Candidate
    fitted: Score
    held_out: Score
    remanence_um: float
    remanent: bool


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """The outcome.

    Attributes:
        experiments: the records, with the rows that were fitted and held out.
        rows: the learned equation first, then its rivals.
        written: the row that goes into the model file.
        learned: how the equation was found.
        identifiability: what the records cannot tell.
        unseen: how far apart the models are on a voltage that was not recorded.
        held_out_by: how rows were held out, a sentence.
        floor_percent: floor of the held-out error: what differs from cycle to cycle, or the noise.
        delay_s: transport delay in every model.
        still_percent: error of the written model without its structure, on the fitted rows.
        findings: sentences of warning.
    """

    experiments: tuple[Experiment, ...]
    rows: tuple[Row, ...]
    written: Row
    learned: Learned
    identifiability: Identifiability
    unseen: Unseen
    held_out_by: str
    floor_percent: float
    delay_s: float
    still_percent: float
    findings: tuple[str, ...]
