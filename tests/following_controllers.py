"""Controllers that follow a model, tuned as a gains file has them, their FMUs and the FMUs of their models."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from bender_export.build import build_plant_fmu
from bender_export.following import FOLLOWING_FMU, FOLLOWING_LOOP, Host, Tuned, build_following
from bender_loop.control.pid import Gains, Limits
from bender_loop.fmu.followed_model import FollowedModel
from bender_plant.model import Model, load_model

PERIOD_S = 0.02


@dataclass(frozen=True)
class Made:
    """A tuned controller, the FMU of its model, its own FMU, and the archive of its loop."""

    tuned: Tuned
    model: Path
    controller: Path
    loop: Path


def late() -> Model:
    """What is left out of the inverse, what belongs to a record, and hysteresis with creep between them."""
    model = load_model("paper")
    for block_id, parameters in (
        ("transport_delay", {"delay_s": 0.03}),
        ("backlash", {"half_width_um": 0.7}),
        ("creep", {"gains": (0.1,), "time_constants_s": (0.4,)}),
        ("thermal_drift", {"amplitude_um": 2.0, "time_constant_s": 1.0}),
        ("sensor_lag", {"time_constant_s": 0.005}),
        ("sensor_quantisation", {"step_um": 0.1}),
    ):
        model = model.with_block(block_id, **parameters)
    return model


MODELS = {"paper": lambda: load_model("paper"), "late": late}


def followed(fmu: Path, **changes: object) -> FollowedModel:
    return followed_as(hashlib.sha256(fmu.read_bytes()).hexdigest(), fmu=fmu.name, **changes)


def followed_as(sha256: str, **changes: object) -> FollowedModel:
    usual: dict[str, object] = {
        "fmu": "model.fmu",
        "sha256": sha256,
        "input": "voltage",
        "output": "displacement",
        "rate_um_per_s": 200.0,
        "curvature_um_per_s2": 4000.0,
        "horizon_ticks": 1,
        "lead_s": 0.0,
        "dead_time_s": 0.0,
        "tolerance_um": 1e-3,
    }
    return FollowedModel(**usual | changes)  # pyright: ignore[reportArgumentType]


def tuned_on(fmu: Path, **changes: object) -> Tuned:
    return Tuned(Gains(0.01, 5.0, 0.01, 0.05), Limits(0.0, 50.0), PERIOD_S, followed(fmu, **changes))


def made(folder: Path, name: str, host: Host | None = None, **changes: object) -> Made:
    model = build_plant_fmu(MODELS[name](), folder / "model.fmu")
    tuned = tuned_on(model, **changes)
    build_following(tuned, model, folder / "out", host)
    return Made(tuned, model, folder / "out" / FOLLOWING_FMU, folder / "out" / FOLLOWING_LOOP)
