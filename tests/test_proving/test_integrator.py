"""The chain's integration and drawn linear systems against scipy's, closed forms, and the record's convention."""

from few import few
import math
from collections.abc import Callable
from dataclasses import dataclass
import numpy as np
import pytest
from bender_proving.physics import lobatto, segments
from bender_proving.chain import Commands, readings_um
from bender_proving.physics.grid import build_grid
from bender_proving.cases.hidden import Hidden
from bender_proving.cases.nominal import FULL_STROKE_UM, OMEGA, settled_um
from bender_proving.physics.play import play
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from bender_proving.systems.linear import LinearSystem, drawn_system
from bender_proving.systems.played import ROW_S, played_system


ZETA = 0.02
CLOSE_UM = 2e-5


@dataclass(frozen=True)
class Physics:
    """Right-hand side of the whole bench, written out once more; the state is v, L, z, x, q, q', q2, q2', r."""

    source_s: float = 0.0
    fall_s: float = 0.0
    leak: float = 0.0
    leak_s: float = 1.0
    squared: float = 0.0
    creep: float = 0.0
    creep_s: float = 1.0
    frequency: float = 1.0
    zeta: float = ZETA
    cubic: float = 0.0
    drag: float = 0.0
    second: float = 0.0
    second_frequency: float = 3.0
    sensor_s: float = 0.0

    def electrode(self, s: NDArray, command: float) -> float:
        falling = self.fall_s > 0.0 and command < s[0]
        return s[0] if self.source_s > 0.0 or falling else command

    def rates(self, _t: float, s: NDArray, command: float) -> list[float]:
        v = self.electrode(s, command)
        seen = v - self.leak * s[1]
        w = s[2] + 0.818 * seen
        driven = w + self.squared * v * v + self.creep * s[3]
        omega, omega2 = OMEGA * self.frequency, OMEGA * self.second_frequency
        tip = self.tip(s)
        tau, zeta = self.source_s or self.fall_s, self.zeta
        return [
            (command - v) / tau if tau else 0.0,
            (v - s[1]) / self.leak_s,
            -0.48 * w + 1.652 * seen - 0.22 * abs(w) - 0.124 * w * abs(w),
            (w - s[3]) / self.creep_s,
            s[5],
            omega**2 * (driven - s[4] - self.cubic * s[4] ** 3) - (2 * zeta * omega + self.drag * abs(s[5])) * s[5],
            s[7],
            omega2**2 * (driven - s[6]) - 2 * 0.01 * omega2 * s[7],
            (tip - s[8]) / self.sensor_s if self.sensor_s else 0.0,
        ]  # fmt: skip

    def tip(self, s: NDArray) -> float:
        return (1.0 - self.second) * s[4] + self.second * s[6]


def integrated(physics: Physics, commands: Commands) -> NDArray:
    """Readings by DOP853 between all that happens."""
    happenings = sorted({*commands.read_s.tolist(), *commands.act_s.tolist()})
    state, command, now, readings = np.zeros(9), 0.0, happenings[0], []
    for then in happenings:
        if then > now:
            done = solve_ivp(physics.rates, (now, then), state, "DOP853", args=(command,), rtol=1e-9, atol=1e-10)
            state, now = done.y[:, -1], then
        if then in commands.read_s:
            readings.append(state[8] if physics.sensor_s else physics.tip(state))
        if then in commands.act_s:
            command = float(commands.voltage_V[np.flatnonzero(commands.act_s == then)[0]])
            if physics.fall_s and command >= state[0]:
                state[0] = command
    return np.array(readings)


def some_commands(rows: int = 8, seed: int = 5) -> Commands:
    rng = np.random.default_rng(seed)
    read_s = np.cumsum(rng.uniform(0.02, 0.045, rows))
    volts = rng.uniform(0.0, 50.0, rows)
    volts[3] = 0.0
    return Commands(read_s, read_s + rng.uniform(5e-4, 6e-3, rows), volts)


def hide(name: str, form: str, **parameters: float) -> Hidden:
    return Hidden(name, form, 0.0, tuple(parameters.items()))


ORACLES: dict[str, tuple[tuple[Hidden, ...], Physics]] = {
    "nominal": ((), Physics()),
    "source": ((hide("source_resistance", "lumped", tau_s=2e-3, second_tau_s=0.0),), Physics(source_s=2e-3)),
    "fall": ((hide("supply_fall_lag", "resistor", tau_s=0.02, bleed_V=0.0),), Physics(fall_s=0.02)),
    "leakage": ((hide("charge_leakage", "one_path", fraction=0.4, tau_s=1.5),), Physics(leak=0.4, leak_s=1.5)),
    "electrostriction": (
        (hide("electrostriction", "quadratic", c_um_per_V2=2e-3, bend_per_V2=0.0),),
        Physics(squared=2e-3),
    ),
    "creep": (
        (hide("creep", "one_unit", growth=0.2 * (math.exp(-0.1 / 0.7) - math.exp(-100 / 0.7)), tau_s=0.7),),
        Physics(creep=0.2, creep_s=0.7),
    ),
    "tip mass": ((hide("tip_mass", "added_mass", frequency_ratio=1.4, static_gain=1.0),), Physics(frequency=1.4)),
    "damping": (
        (hide("structural_damping", "viscous_and_drag", damping_ratio=0.004, drag_per_um=2e-4),),
        Physics(zeta=0.004, drag=2e-4),
    ),
    "stiffening": (
        (hide("stiffening", "cubic", k3_per_um2=0.3 / FULL_STROKE_UM**2, quintic_per_um2=0.0),),
        Physics(cubic=0.3 / FULL_STROKE_UM**2),
    ),
    "second mode": (
        (hide("second_mode", "parts_of_one", share=0.2, frequency_ratio=6.267, damping_ratio=0.01),),
        Physics(second=0.2, second_frequency=6.267),
    ),
    "sensor lag": ((hide("sensor_lag", "one_pole", tau_s=3e-3, second_tau_s=0.0),), Physics(sensor_s=3e-3)),
    "a pair": (
        (
            hide("source_resistance", "lumped", tau_s=0.03, second_tau_s=0.0),
            hide("sensor_lag", "one_pole", tau_s=0.01, second_tau_s=0.0),
        ),
        Physics(source_s=0.03, sensor_s=0.01),
    ),
}


@pytest.mark.parametrize("name", few(ORACLES, 0, 4, 8))
def test_readings_agree_with_scipy(name: str):
    hidden, physics = ORACLES[name]
    commands = some_commands()
    expected = integrated(physics, commands)
    assert np.ptp(expected) > 20.0
    np.testing.assert_allclose(readings_um(commands, hidden), expected, atol=CLOSE_UM, rtol=0)


def test_vibrometer_rows_agree_with_scipy():
    time_s = np.arange(100) / 4000.0
    volts = 20.0 + 3.0 * np.sin(2 * np.pi * 110.0 * time_s) + 10.0 * (time_s > 0.015)
    commands = Commands(time_s, time_s, volts)
    np.testing.assert_allclose(readings_um(commands), integrated(Physics(), commands), atol=CLOSE_UM, rtol=0)


@given(k=st.integers(0, 6), volts=st.floats(0.0, 50.0))
@settings(max_examples=20)
def test_a_row_is_read_before_its_voltage_acts(k: int, volts: float):
    commands = some_commands()
    other = commands.voltage_V.copy()
    other[k] = volts
    before = readings_um(commands)
    after = readings_um(Commands(commands.read_s, commands.act_s, other))
    np.testing.assert_array_equal(after[: k + 1], before[: k + 1])
    if abs(volts - commands.voltage_V[k]) > 1.0:
        assert abs(after[k + 1] - before[k + 1]) > 1e-3


def test_twenty_five_microseconds_show():
    commands = some_commands()
    late = Commands(commands.read_s, commands.act_s + 25e-6, commands.voltage_V)
    assert np.max(np.abs(readings_um(late) - readings_um(commands))) > 0.05


@pytest.mark.parametrize(("command_s", "reading_s"), [(0.04, 0.0), (0.0, 0.04), (0.01, 0.03)])
def test_a_delay_is_the_same_wherever_it_sits(command_s: float, reading_s: float):
    commands = some_commands()
    delayed = hide("transport_delay", "both", command_s=command_s, reading_s=reading_s)
    read_s = np.append(0.0, commands.read_s - 0.04)
    expected = readings_um(Commands(read_s, np.append(0.0, commands.act_s), np.append(0.0, commands.voltage_V)))[1:]
    at_rest = commands.read_s - 0.04 <= 0.0
    np.testing.assert_allclose(readings_um(commands, (delayed,))[~at_rest], expected[~at_rest], atol=CLOSE_UM, rtol=0)


def test_a_held_voltage_settles_where_the_equation_says():
    time_s = np.arange(0.0, 20.0, 0.05)
    commands = Commands(time_s, time_s, np.full(len(time_s), 30.0))
    assert readings_um(commands)[-1] == pytest.approx(settled_um(30.0), abs=1e-6)


def test_a_lag_and_a_mode_have_their_closed_forms():
    step_s = np.full(200, 4e-4)
    t = np.arange(1, 201) * 4e-4
    source = np.ones((200, lobatto.NODES))
    np.testing.assert_allclose(lobatto.lag(source, step_s, 3e-3, 0.0)[:, -1], 1.0 - np.exp(-t / 3e-3), atol=1e-9)
    q, p = lobatto.linear_mode(source, step_s, OMEGA, ZETA)
    fast = OMEGA * math.sqrt(1.0 - ZETA**2)
    expected = 1.0 - np.exp(-ZETA * OMEGA * t) * (np.cos(fast * t) + ZETA * OMEGA / fast * np.sin(fast * t))
    np.testing.assert_allclose(q[:, -1], expected, atol=1e-9)
    np.testing.assert_allclose(p[:, -1], np.exp(-ZETA * OMEGA * t) * OMEGA**2 / fast * np.sin(fast * t), atol=1e-6)


def test_collocation_integrates_polynomials_of_degree_seven():
    exact = 1.0 / np.arange(1, 9)
    powers = lobatto.C[:, None] ** np.arange(8)
    np.testing.assert_allclose(lobatto.A[-1] @ powers, exact, atol=1e-14)


def euler(rate: Callable[[float, float], float], target: list[float], hold_s: float) -> NDArray:
    v, dt, out = 0.0, hold_s / 4000, []
    for c in target:
        for _ in range(4000):
            v += dt * rate(v, c)
        out.append(v)
    return np.array(out)


@pytest.mark.parametrize(
    ("answer", "rate"),
    [
        (segments.Answer(segments.SLEW, 400.0, 0.0), lambda v, c: max(-400.0, min(400.0, (c - v) * 4e4))),
        (segments.Answer(segments.SLEW, 400.0, 0.01), lambda v, c: max(-400.0, min(400.0, (c - v) / 0.01))),
        (segments.Answer(segments.LAG, 0.03, 0.0), lambda v, c: (c - v) / 0.03),
    ],
)
def test_the_supply_follows_its_equation(answer: segments.Answer, rate: Callable[[float, float], float]):
    target, hold_s = np.array([40.0, 5.0, 20.0, 0.0, 8.0]), 0.05
    act_s = np.arange(5) * hold_s
    states = segments.beginnings(answer.kind, answer.a, answer.b, np.append(act_s, 0.25), np.append(target, 0.0))
    np.testing.assert_allclose(states[1:, 1], euler(rate, target.tolist(), hold_s), atol=0.02)


def test_two_poles_agree_with_scipy():
    answer = segments.Answer(segments.LAG, 0.03, 0.004)
    target, act_s = np.array([40.0, 5.0, 20.0, 0.0]), np.arange(4.0) * 0.02
    states = segments.beginnings(answer.kind, answer.a, answer.b, act_s, target)
    s, expected = np.zeros(2), [0.0]
    for c in target[:-1]:
        s = solve_ivp(
            lambda _t, x, c=c: [(c - x[0]) / 0.03, (x[0] - x[1]) / 0.004], (0, 0.02), s, rtol=1e-10, atol=1e-12
        ).y[:, -1]
        expected.append(float(s[1]))
    np.testing.assert_allclose(states[:, 1], expected, atol=1e-7)


def test_a_bleed_empties_in_finite_time_and_rises_are_instant():
    act_s, target = np.array([0.0, 1.0, 2.0, 3.0]), np.array([50.0, 10.0, 10.0, 30.0])
    answer = segments.Answer(segments.FALL, 0.1, 0.5)
    states = segments.beginnings(answer.kind, answer.a, answer.b, act_s, target)
    assert states[:, 1].tolist() == [0.0, 50.0, 10.0, 10.0]
    corner = segments.corners(answer, act_s, target, states)
    assert np.any(np.isclose(corner, 1.0 + 0.1 * math.log((40.0 + 0.5) / 0.5)))


@given(half_width=st.floats(0.1, 5.0), seed=st.integers(0, 50))
@settings(max_examples=10)
def test_play_meets_the_turning_points(half_width: float, seed: int):
    rng = np.random.default_rng(seed)
    amplitude, phase = rng.uniform(5.0, 30.0), rng.uniform(0.0, 6.0)
    grid = build_grid(np.array([0.1]), np.empty(0), 0.0, 2.3e-4)
    t = grid.nodes_s
    q = amplitude * (np.sin(OMEGA * t + phase) - math.sin(phase)) * np.exp(-10.0 * t)
    p = (
        amplitude
        * np.exp(-10.0 * t)
        * (OMEGA * np.cos(OMEGA * t + phase) - 10.0 * (np.sin(OMEGA * t + phase) - math.sin(phase)))
    )
    fine = np.linspace(0.0, 0.1, 100 * len(grid.step_s) + 1)
    y, expected = 0.0, []
    for x in amplitude * (np.sin(OMEGA * fine + phase) - math.sin(phase)) * np.exp(-10.0 * fine):
        y = min(max(y, x - half_width), x + half_width)
        expected.append(y)
    found = play(q, p, grid.step_s, half_width)[:, -1]
    np.testing.assert_allclose(found, expected[100::100], atol=5e-5)


@given(seed=st.integers(0, 200), longest=st.floats(1e-4, 1e-2))
@settings(max_examples=20)
def test_the_grid_is_gapless_and_ends_at_every_reading(seed: int, longest: float):
    rng = np.random.default_rng(seed)
    read_s = np.cumsum(rng.uniform(0.001, 0.05, 12))
    grid = build_grid(read_s, rng.uniform(0.0, 0.6, 20), float(read_s[0]), longest)
    ends = grid.start_s + grid.step_s
    np.testing.assert_allclose(ends[:-1], grid.start_s[1:], atol=1e-12)
    assert np.all(grid.step_s > 0.0)
    assert np.max(grid.step_s) <= longest * (1 + 1e-8)
    assert grid.reading[0] == -1
    np.testing.assert_allclose(ends[grid.reading[1:]], read_s[1:], atol=1e-9)


@given(
    frequency_Hz=st.floats(0.3, 30.0),
    phase=st.floats(0.0, 6.0),
    taus_s=st.tuples(st.floats(1e-3, 0.4), st.sampled_from([0.0, 1e-3]), st.sampled_from([0.0, 3e-4])),
    delay_s=st.sampled_from([0.0, 0.25]),
)
@settings(max_examples=25)
def test_a_disturbance_has_gone_on_before_the_record(
    frequency_Hz: float, phase: float, taus_s: tuple[float, float, float], delay_s: float
):
    time_s = np.arange(40) / 30.0
    omega = 2.0 * math.pi * frequency_Hz
    disturbed = hide(
        "periodic_disturbance", "sine", amplitude_um=3.0, frequency_Hz=frequency_Hz, phase_rad=phase, overtone=0.0
    )
    first, second, third = taus_s
    lagging = hide("sensor_lag", "small_poles", tau_s=first, second_tau_s=second, third_tau_s=third)
    late = hide("transport_delay", "both", command_s=0.0, reading_s=delay_s)
    found = readings_um(Commands(time_s, time_s, np.zeros(40)), (disturbed, lagging, late))
    size = 3.0 / math.prod(math.hypot(1.0, omega * x) for x in taus_s)
    turn = omega * (time_s - delay_s) + phase - sum(math.atan(omega * x) for x in taus_s)
    np.testing.assert_allclose(found, size * np.sin(turn), atol=1e-4, rtol=0)


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.25])
def test_the_answer_is_that_of_an_integrator(delay_s: float):
    system = LinearSystem(0.7, (0.1, 0.03), ((2.0, 0.05, 0.8), (7.0, 0.03, 0.2)), delay_s)
    time_s = np.arange(60, dtype=np.float64) * 0.02
    volts = np.random.default_rng(1).uniform(0.0, 10.0, 60)
    A, B, C = system.matrices()
    state, read, begin = np.zeros(system.order), [0.0], 0.0
    edges = np.unique(np.concatenate([time_s, time_s + delay_s]))
    for end in edges[1:]:
        held = np.searchsorted(time_s + delay_s, begin + 1e-9, side="right") - 1
        u = volts[held] if held >= 0 else 0.0
        run = solve_ivp(lambda t, x, u=u: A @ x + B * u, (begin, end), state, rtol=1e-11, atol=1e-12)
        state, begin = run.y[:, -1], end
        if np.isclose(time_s, end, atol=1e-9).any():
            read.append(float(C @ state))
    assert system.answer(time_s, volts) == pytest.approx(np.array(read[:60]), abs=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_draws_have_their_order_and_unit_shares(order: int):
    for seed in range(20):
        system = drawn_system(order, np.random.default_rng(seed))
        assert system.order == order
        assert system.modes == () or sum(share for *_, share in system.modes) == pytest.approx(1.0)
        A, B, C = system.matrices()
        assert -C @ np.linalg.solve(A, B) == pytest.approx(system.gain)
        assert np.linalg.eigvals(A).real.max() < 0.0


def test_the_same_seed_plays_the_same():
    a, b = played_system(3, 7), played_system(3, 7)
    assert np.array_equal(a.reading_um[0], b.reading_um[0])
    assert not np.array_equal(a.voltage_V[0], a.voltage_V[1])
    assert a.time_s[1] - a.time_s[0] == pytest.approx(ROW_S)
