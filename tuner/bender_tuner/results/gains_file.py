"""`gains.toml`: the tuned gains in every form, with units in the names.

Only `sampling_period_s`, `[parallel]`, `[limits]`, `[units]` and `[model_following]` are read; `[isa]` and
`[discrete]` are written for other controllers and must agree with `[parallel]` where they are present, so that a file
never says two things. Where `[units]` stands, every V and um of the names stands for its units.
The gains hold with and without the model that `[model_following]` names.
"""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ConfigDict, ValidationError

from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import InputError
from bender_loop.fmu.followed_model import FollowedModel, followed_model
from bender_loop.shell.complaint import first_complaint
from bender_loop.shell.files import write_atomically
from bender_loop.shell.toml_file import read_toml_file
from bender_loop.tables.quantities import USUAL
from bender_report.wording import unit_text
from bender_tuner.rules.gain_forms import to_discrete, to_isa

_AGREEMENT = 1e-6
_LARGEST, _SHORTEST_PERIOD_S = 1e12, 1e-9
"""Far beyond any controller, and far from where products of such numbers overflow."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Parallel(_Table):
    proportional_V_per_um: float
    integral_V_per_um_s: float
    derivative_V_s_per_um: float = 0.0
    filter_time_s: float = 0.0
    derivative_on_error: bool = False


class _Limits(_Table):
    lower_V: float = 0.0
    upper_V: float = 50.0
    tracking_time_s: float = 0.0


class _Isa(_Table):
    gain_V_per_um: float
    integral_time_s: float
    derivative_time_s: float
    filter_time_s: float


class _Discrete(_Table):
    denominator: list[float]
    setpoint_V_per_um: list[float]
    measurement_V_per_um: list[float]


class _Following(_Table):
    fmu: str
    sha256: str
    input: str
    output: str
    rate_um_per_s: float
    curvature_um_per_s2: float
    horizon_ticks: int
    lead_s: float
    dead_time_s: float
    tolerance_um: float
    slew_V_per_s: float = math.inf
    left_out: dict[str, float] = {}
    parameters: dict[str, float] = {}
    units: list[str] = []
    rms_um: float = 0.0
    preview_horizon_ticks: int = 0
    held_back: float = 0.0


class _Units(_Table):
    command: str
    reading: str


class _GainsFile(_Table):
    sampling_period_s: float
    units: _Units | None = None
    parallel: _Parallel
    limits: _Limits = _Limits()
    isa: _Isa | None = None
    discrete: _Discrete | None = None
    model_following: _Following | None = None


def write_gains(
    path: Path,
    gains: Gains,
    limits: Limits,
    sampling_period_s: float,
    following: FollowedModel | None = None,
    units: tuple[str, str] = USUAL[:2],
) -> None:
    """Write the gains in parallel, ISA (where it exists) and discrete form; ValueError for a bad period.

    Args:
        path: of the file.
        gains: of the PID block.
        limits: of the command.
        sampling_period_s: time between samples.
        following: the model that is followed.
        units: of command and reading; said in the file where they are not V and um.
    """
    own = {} if units == USUAL[:2] else {"units": {"command": units[0], "reading": units[1]}}
    table: dict[str, Any] = {
        "sampling_period_s": sampling_period_s,
        **own,
        "parallel": asdict(gains),
        "limits": asdict(limits),
    }
    table |= _derived_tables(gains, sampling_period_s)
    if following is not None:
        table["model_following"] = asdict(following)
    write_atomically(path, tomli_w.dumps(table))


def read_gains(path: Path) -> tuple[Gains, Limits, float]:
    """Read (gains, limits, sampling_period_s).

    Raises:
        InputError: the file cannot be read, is not TOML, has an unknown or missing key or a value out of bounds (NaN
            gains among them), or its derived forms contradict `[parallel]`.
    """
    return read_controller(path)[:3]


def read_units(path: Path) -> tuple[str, str] | None:
    """Read the units of command and reading: those that the file says, else those of the model that it follows.

    Returns:
        None where nothing is said: V and um, or those of whoever wrote the file.

    Raises:
        InputError: as `read_gains`.
    """
    content = _validated(path, read_toml_file(path, "a gains file (TOML)"))
    if content.units is not None:
        return content.units.command, content.units.reading
    followed = [] if content.model_following is None else content.model_following.units
    return (followed[0], followed[1]) if len(followed) > 1 else None


def require_units(path: Path, units: tuple[str, str], of: str) -> None:
    """Refuse gains that say other units than those of what they are to control.

    Args:
        path: of the gains.
        units: of the command and the reading.
        of: what has them, and what to do where it has not.

    Raises:
        InputError: the file cannot be read, or says other units.
    """
    found = read_units(path)
    if found is not None and found != units:
        said, wanted = (" and ".join(unit_text(x) for x in y) for y in (found, units))
        raise InputError(f"{path}: found gains in {said}, expected {wanted}, the units of {of}")


def read_bench_gains(path: Path) -> tuple[Gains, Limits, float]:
    """Read (gains, limits, sampling_period_s) for a bench, which takes volts and reads micrometres.

    Raises:
        InputError: as `read_gains`, or the gains are in other units.
    """
    require_units(path, USUAL[:2], "a bench")
    return read_gains(path)


def read_controller(path: Path) -> tuple[Gains, Limits, float, FollowedModel | None]:
    """Read (gains, limits, sampling_period_s, model following); None for a file of the PID block alone.

    Raises:
        InputError: as `read_gains`.
    """
    content = _validated(path, read_toml_file(path, "a gains file (TOML)"))
    _check_sizes(path, content)
    try:
        gains = Gains(**content.parallel.model_dump())
        limits = Limits(**content.limits.model_dump())
        derived = _derived_tables(gains, content.sampling_period_s)
        said = content.model_following
        followed = None if said is None else followed_model(said.model_dump())
    except (ValueError, ArithmeticError) as error:
        raise InputError(f"{path}: {error}") from error
    for name in ("isa", "discrete"):
        found = getattr(content, name)
        if found is not None and not _agree(found.model_dump(), derived.get(name)):
            raise InputError(
                f"{path}: [{name}] does not agree with [parallel]; correct it, or remove it: only [parallel] is read"
            )
    return gains, limits, content.sampling_period_s, followed


def _check_sizes(path: Path, content: _GainsFile) -> None:
    sizes = {f"parallel.{key}": value for key, value in content.parallel.model_dump().items()} | {
        f"limits.{key}": value for key, value in content.limits.model_dump().items() if math.isfinite(value)
    }
    for key, value in (sizes | {"sampling_period_s": content.sampling_period_s}).items():
        if abs(value) > _LARGEST:
            raise InputError(f"{path}: {key}: found {value!r}, expected at most {_LARGEST:g} in size")
    if 0.0 < content.sampling_period_s < _SHORTEST_PERIOD_S:
        raise InputError(
            f"{path}: sampling_period_s: found {content.sampling_period_s!r}, expected at least {_SHORTEST_PERIOD_S:g}"
        )


def _derived_tables(gains: Gains, sampling_period_s: float) -> dict[str, Any]:
    discrete = to_discrete(gains, sampling_period_s)
    tables: dict[str, Any] = {
        "discrete": {
            "denominator": list(discrete.denominator),
            "setpoint_V_per_um": list(discrete.setpoint_V_per_um),
            "measurement_V_per_um": list(discrete.measurement_V_per_um),
        }
    }
    isa = to_isa(gains)
    return tables if isa is None else {"isa": asdict(isa)} | tables


def _validated(path: Path, table: dict[str, Any]) -> _GainsFile:
    try:
        return _GainsFile.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{path}: {first_complaint(error)}") from error


def _agree(found: object, expected: object) -> bool:
    if isinstance(found, dict) and isinstance(expected, dict):
        return found.keys() == expected.keys() and all(_agree(found[key], expected[key]) for key in found)
    if isinstance(found, list) and isinstance(expected, list):
        return len(found) == len(expected) and all(map(_agree, found, expected))
    if isinstance(found, float) and isinstance(expected, float):
        return math.isclose(found, expected, rel_tol=_AGREEMENT, abs_tol=1e-12)
    return False
