"""The bench as a chain: command, supply, material, structure, surroundings, sensor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bender_proving.physics import material, segments, sensor, structure, supply, surroundings
from bender_proving.cases import nominal, outside
from bender_proving.cases.effects import effect, of_stage
from bender_proving.physics.grid import Grid, build_grid
from bender_proving.cases.hidden import Hidden
from bender_proving.physics.lobatto import Array
from bender_proving.physics.segments import Answer

_LONGEST = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """Rows as the bench meets them, shapes (n,): read at read_s[k], then commanded voltage_V[k] from act_s[k] on."""

    read_s: Array
    act_s: Array
    voltage_V: Array


def readings_um(commands: Commands, hidden: tuple[Hidden, ...] = (), linear: bool = False) -> Array:
    """What a sensor without noise and rounding reads, shape (n,); nan from where a softening spring gave way.

    The bench is at rest at 0 V until the first command acts, in a room that has been as it is for long. Reading k is
    true at read_s[k], before that row's command. Effects of one stage act in the order given. A linear bench has a gain
    in the place of equation (30).
    """
    grid, voltage_V = _electrodes(commands, hidden)
    tip_um = _tip(voltage_V, grid, hidden, linear)
    for item in of_stage(hidden, "surroundings"):
        tip_um = surroundings.surround(item, tip_um, grid.nodes_s)
    poles_s: list[float] = []
    for item in of_stage(hidden, "sensor"):
        own_s = sensor.poles_s(item)
        behind = ((*poles_s, *own_s[: k + 1]) for k in range(len(own_s)))
        tip_um = sensor.follow(item, tip_um, grid, [_standing_um(hidden, grid.start_s[:1], x).item() for x in behind])
        poles_s += own_s
    late_s = sum(supply.reading_delay_s(item) for item in hidden)
    at_rest = grid.reading < 0
    rows_um = grid.at_rows(tip_um)
    rows_um[at_rest] = _standing_um(hidden, commands.read_s[at_rest] - late_s, poles_s)
    for item in of_stage(hidden, "sensor"):
        rows_um = sensor.map_rows(item, rows_um)
    return rows_um


def _standing_um(hidden: tuple[Hidden, ...], time_s: Array, poles_s: Sequence[float]) -> Array:
    """What a sensor with these poles shows of the bench at rest."""
    around = (surroundings.standing_um(item, time_s, poles_s) for item in of_stage(hidden, "surroundings"))
    return sum(around, start=np.zeros_like(time_s))


def terminals_V(commands: Commands, hidden: tuple[Hidden, ...], at_s: Array) -> Array:
    """Voltage that the supply puts out at ascending instants, shape (m,); 0 before the first command acts."""
    act_s, target_V, answer, states = _supplied(commands, hidden)
    nodes_s = np.ascontiguousarray(at_s, dtype=np.float64)[:, None]
    voltage_V = segments.voltages(answer.kind, answer.a, answer.b, act_s, target_V, states, nodes_s, nodes_s[:, 0])
    for item in of_stage(hidden, "supply"):
        voltage_V = supply.at_electrodes(item, voltage_V)
    return voltage_V[:, 0]


def _supplied(commands: Commands, hidden: tuple[Hidden, ...]) -> tuple[Array, Array, Answer, Array]:
    """When commands act, what they ask for, how the supply answers, and its state when each begins to act."""
    act_s, target_V, answer = commands.act_s, commands.voltage_V, Answer()
    moves = np.diff(target_V, prepend=0.0) != 0.0
    moves[0] = True
    act_s, target_V = act_s[moves], target_V[moves]
    for item in of_stage(hidden, "outside"):
        act_s = outside.shift_commands(item, act_s, target_V)
    for item in of_stage(hidden, "supply"):
        act_s, target_V = supply.shift_commands(item, act_s, target_V)
        answer = supply.answer(item) or answer
    return act_s, target_V, answer, segments.beginnings(answer.kind, answer.a, answer.b, act_s, target_V)


def _electrodes(commands: Commands, hidden: tuple[Hidden, ...]) -> tuple[Grid, Array]:
    """Sub-steps and the electrode voltage at their nodes, shape (n, 5)."""
    act_s, target_V, answer, states = _supplied(commands, hidden)
    borders = np.concatenate([act_s, segments.corners(answer, act_s, target_V, states)])
    late_s = sum(supply.reading_delay_s(item) for item in hidden)
    grid = build_grid(commands.read_s - late_s, borders, float(commands.read_s[0]), _longest_step_s(hidden))
    voltage_V = segments.voltages(answer.kind, answer.a, answer.b, act_s, target_V, states, grid.nodes_s, grid.middle_s)
    for item in of_stage(hidden, "supply"):
        voltage_V = supply.at_electrodes(item, voltage_V)
    return grid, voltage_V


def _longest_step_s(hidden: tuple[Hidden, ...]) -> float:
    limits = [structure.longest_step_s(of_stage(hidden, "structure"))]
    read = of_stage(hidden, "sensor")
    rates = [sensor.fastest_rad_per_s(item) for item in read]
    if any(rates):
        rates += [surroundings.fastest_rad_per_s(item) for item in of_stage(hidden, "surroundings")]
    if any(effect(item.id).stage == "outside" for item in hidden):
        rates.append(2.0 * nominal.OMEGA)
    return min(limits + [_LONGEST / rate for rate in rates if rate > 0.0])


def _tip(voltage_V: Array, grid: Grid, hidden: tuple[Hidden, ...], linear: bool) -> Array:
    """The tip in its room, shape (n, 5), but for the effects of the surroundings' own stage."""
    strange = of_stage(hidden, "outside")
    seen_V = voltage_V
    for item in of_stage(hidden, "material"):
        seen_V = material.before(item, seen_V, grid)
    w_um = nominal.GAIN_UM_PER_V * seen_V if linear else nominal.material(np.ascontiguousarray(seen_V), grid.step_s)
    for item in of_stage(hidden, "material"):
        w_um = material.after(item, w_um, voltage_V, grid)
    for item in strange:
        w_um = outside.after_material(item, w_um, voltage_V, grid)
    replaced = [tip for item in strange if (tip := outside.modes(item, w_um, grid)) is not None]
    swing = structure.tip(of_stage(hidden, "structure"), w_um, grid)
    tip_um = replaced[0] if replaced else swing.position_um
    for item in strange:
        tip_um = outside.after_structure(item, tip_um, voltage_V, grid)
    return tip_um
