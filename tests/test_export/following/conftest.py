import math

import pytest
from following_controllers import Made, made

from bender_export.following import Host


@pytest.fixture(scope="session")
def following_paper(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory.mktemp("following"), "paper")


@pytest.fixture(scope="session")
def following_late(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Of another model, with a bound on the command's rate, no shaper, and the tip as what is measured."""
    changes: dict[str, object] = {
        "slew_V_per_s": 800.0, "rate_um_per_s": math.inf, "curvature_um_per_s2": math.inf, "horizon_ticks": 2,
        "lead_s": 0.001, "output": "tip_displacement", "parameters": {"calibration.gain": 1.05},
    }  # fmt: skip
    return made(tmp_path_factory.mktemp("following"), "late", Host(1, 0.004), **changes)
