"""The replay: from what the log says was measured to the commands, compared with what the log says was commanded.

Equal to the last bit, or the log and the controller do not belong together.
"""

from dataclasses import dataclass
from pathlib import Path

from bender_hil.log.read_run import RunLog, malformed_is_bad_input, read_run
from bender_hil.runner.control_law import Memory, decide
from bender_hil.runner.voltages import Voltages
from bender_loop.control.pid import Gains, Limits


@dataclass(frozen=True, slots=True)
class Replayed:
    """What came of it.

    Attributes:
        ticks: commands recomputed.
        different: of those, how many are not the same bits.
        first: sequence number of the first that differs.
        largest_V: largest difference.
    """

    ticks: int
    different: int
    first: int | None
    largest_V: float


def replay_run(directory: Path) -> Replayed:
    """Recompute the commands of a run.

    Raises:
        InputError: there is no run in the directory, or its log is damaged.
    """
    log = read_run(directory)
    with malformed_is_bad_input(directory):
        commands = _AGAIN.get(log.start["program"]["mode"], _open)(log)
        pairs = [(tick, again) for tick, again in zip(log.ticks, commands, strict=True) if tick["command_V"] != again]
        return Replayed(
            len(commands),
            len(pairs),
            int(pairs[0][0]["sequence"]) if pairs else None,
            max((abs(float(tick["command_V"]) - again) for tick, again in pairs), default=0.0),
        )


def _closed(log: RunLog) -> list[float]:
    program = log.start["program"]
    gains, limits, slew = Gains(**program["gains"]), Limits(**program["limits"]), program["slew_V_per_s"]
    memory = Memory()
    commands = []
    for tick in log.ticks:
        if tick["measured_um"] is not None:
            memory = decide(gains, limits, slew, memory, tick["setpoint_um"], tick["measured_um"], tick["dt_s"])
        commands.append(memory.command_V)
    return commands


def _following(log: RunLog) -> list[float]:
    from bender_hil.runner.following_program import commands_again

    return commands_again(log.start, list(log.ticks), log.directory)


def _foreign(log: RunLog) -> list[float]:
    from bender_hil.runner.foreign_program import foreign_commands_again

    return foreign_commands_again(log.start["program"], list(log.ticks), log.directory)


def _open(log: RunLog) -> list[float]:
    program = log.start["program"]
    voltages = Voltages(tuple(program["times_s"]), tuple(program["levels_V"]), program["duration_s"])
    return [voltages.at(tick["time_s"]) for tick in log.ticks]


_AGAIN = {"closed_loop": _closed, "model_following": _following, "controller_fmu": _foreign}
"""How the commands of a run come about again, by its mode."""
