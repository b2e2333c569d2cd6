"""Figure 11 of the reproduction: BAS-PID and ZN-PID each have rows of their own."""

import numpy as np

from bender_loop.control.metrics import step_metrics
from bender_loop.control.trace import Trace
from bender_studies.reproduction.exhibits.figure_11 import SETPOINT_UM, Run, _rows
from bender_studies.reproduction.printed import BAS_ON_THE_BENCH, ZN_ON_THE_BENCH


def run(name: str, tau_s: float) -> Run:
    time_s = np.arange(0.0, 6.0, 1.0 / 30.0)
    tip_um = -SETPOINT_UM * np.expm1(-time_s / tau_s)
    trace = Trace(time_s, np.full(time_s.size, SETPOINT_UM), tip_um, tip_um, tip_um)
    return Run(name, trace, step_metrics(trace, SETPOINT_UM))


def test_ours_stands_beside_bas_alone() -> None:
    bas, zn, ours = run("bas", 0.4), run("zn", 1.0), run("ours", 0.1)
    first, second = _rows("BAS-PID", BAS_ON_THE_BENCH, bas, ours), _rows("ZN-PID", ZN_ON_THE_BENCH, zn, None)
    assert [x.quantity.partition(": ")[2] for x in first] == [x.quantity.partition(": ")[2] for x in second]
    assert all(x.quantity.startswith("ZN-PID") and x.ours is None for x in second)
    assert first[1].paper_mode == bas.metrics.rise_time_s
    assert first[1].ours == ours.metrics.rise_time_s
    assert second[1].paper_mode == zn.metrics.rise_time_s


def test_a_rule_without_a_loop_has_empty_rows() -> None:
    assert all(x.paper_mode is None for x in _rows("ZN-PID", ZN_ON_THE_BENCH, None, None))
