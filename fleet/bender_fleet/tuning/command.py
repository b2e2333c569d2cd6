"""The tuning of a fleet, from its directory to its results."""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bender_fleet.sources.keys import folder_name
from bender_fleet.tuning.arguments import MOST_GROUPS, MOST_UNASKED
from bender_fleet.tuning.groups import grouped
from bender_fleet.tuning.plants import Opened, UnitPlant, corrected_models, opened
from bender_fleet.tuning.search import (
    Tuned,
    UnitFigures,
    figures,
    own_gains,
    quantiles,
    servable,
    tuned_on,
    tuned_on_nominal,
)
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, unused, write_atomically, write_result
from bender_loop.shell.progress import print_table
from bender_report.page import Page, Section, Table, render
from bender_tuner.results.gains_file import write_gains
from bender_tuner.task.session import Bars
from bender_tuner.task.settings import TuneSettings, make_settings

TUNING, PAGE = "tuning.json", "page.html"
FEWEST = 4
_TOLD = 8


@dataclass(slots=True)
class FleetTuning:
    """What the tuning of a fleet came to.

    Attributes:
        gains: of every group, with the bound on Ms that they keep.
        nominal: gains tuned on the nominal model with ±30 %.
        groups: units of every group: those that its gains serve best.
        held_out: names of the units that no search saw.
        ours: figures of every unit under the gains that it takes.
        theirs: the same under the nominal gains.
        unserved: units that the gains do not serve, and why.
        keeping: units that the nominal gains serve best.
        own: gains of their own, for units that no set serves.
    """

    gains: list[Tuned]
    nominal: Gains
    groups: list[list[str]]
    held_out: list[str]
    ours: list[UnitFigures] = field(default_factory=list)
    theirs: list[UnitFigures] = field(default_factory=list)
    unserved: dict[str, str] = field(default_factory=dict)
    keeping: list[str] = field(default_factory=list)
    own: dict[str, Gains] = field(default_factory=dict)


def run_tune(arguments: argparse.Namespace) -> int:
    """Tune, write gains, figures and a page, print the table.

    Raises:
        InputError: the fleet, a setting or the output directory cannot be used; nothing was written.
        RunError: a plant failed, or no gains hold the loops.
    """
    settings = settings_of(arguments)
    models = corrected_models(arguments.fleet)
    out: Path = unused(arguments.fleet / "tune") if arguments.out is None else arguments.out
    if arguments.out is not None and out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}: found files, expected an empty directory; choose another one with --out")
    with Bars() as bars:
        found = tune_fleet(
            models, arguments.nominal, settings, arguments.groups, arguments.held_out, bars,
            is_firm=arguments.max_ms is not None,
        )  # fmt: skip
    prepare_directory(out)
    _write(out, found, settings, arguments)
    _print(found, settings, out)
    return 0


def settings_of(arguments: argparse.Namespace) -> TuneSettings:
    """Return the settings of each search.

    Raises:
        InputError: a setting is out of its range.
    """
    if arguments.groups is not None and not 1 <= arguments.groups <= MOST_GROUPS:
        raise InputError(f"--groups: found {arguments.groups}, expected 1 to {MOST_GROUPS}")
    if not 0.0 < arguments.held_out < 1.0:
        raise InputError(f"--held-out: found {arguments.held_out:g}, expected more than 0 and less than 1")
    lower_V, upper_V = arguments.voltage_limits
    return make_settings(
        setpoint_um=arguments.setpoint, rate_Hz=arguments.rate, latency_frames=arguments.latency,
        duration_s=arguments.duration, lower_V=lower_V, upper_V=upper_V, max_ms=arguments.max_ms,
        evaluations=arguments.evaluations, seed=arguments.seed,
    )  # fmt: skip


def tune_fleet(
    models: dict[str, Path],
    nominal: str,
    settings: TuneSettings,
    count: int | None,
    held_out: float,
    bars: Any,
    *,
    is_firm: bool = False,
) -> FleetTuning:
    """Tune on a part of the units, judge on all; a bound on Ms that is not firm may give way, see `tuned_on`.

    Args:
        models: of every unit by its name.
        nominal: model to compare with.
        settings: of each search.
        count: of groups; None for as few as serve the units: none eased in its bound, none slower than under the
            nominal gains.
        held_out: share of the units.
        bars: is told how far the work is.
        is_firm: the bound on Ms may not give way.

    Raises:
        InputError: there are too few units, or the nominal model cannot be used.
        RunError: a plant failed, or no gains hold the loops.
    """
    from bender_native.ready import ready_plant_fmu

    with opened(models, settings, lambda k, n, name: bars("opening the units", k, n, name)) as fleet:
        fleet = servable(fleet, settings)
        if len(fleet.plants) < FEWEST:
            raise InputError(
                f"found {len(fleet.plants)} units that a controller can bring to {settings.setpoint_um:g} µm within "
                f"{settings.duration_s:g} s, expected at least {FEWEST}; choose another --setpoint or --duration"
            )
        rng = np.random.default_rng(settings.seed)
        seen = np.zeros(len(fleet.plants), dtype=bool)
        seen[rng.permutation(seen.size)[: max(1, round((1.0 - held_out) * seen.size))]] = True
        start = tuned_on_nominal(ready_plant_fmu(nominal), settings, bars)
        ways = range(1, MOST_UNASKED + 1) if count is None else (count,)
        labels, tuned = _as_few_as_serve(
            fleet.plants, seen, ways, rng, lambda own: tuned_on(own, start, settings, bars)
        )
        groups = [[x for x, at in zip(fleet.plants, labels, strict=True) if at == k] for k in range(len(tuned))]
        names = {x.name for x, s in zip(fleet.plants, seen, strict=True) if s}
        for k, own in enumerate(groups):
            if not (is_firm or tuned[k].is_enough):
                tuned[k] = tuned_on([x for x in own if x.name in names], start, settings, bars, is_firm=False)
        aside = [x.name for x in fleet.plants if x.name not in names]
        found = FleetTuning([], start, [], aside)
        return _judged_all(found, fleet, tuned, settings, only_these=count is not None)


def _as_few_as_serve(
    plants: Sequence[UnitPlant],
    seen: np.ndarray,
    ways: Sequence[int],
    rng: np.random.Generator,
    tune: Callable[[list[UnitPlant]], Tuned],
) -> tuple[np.ndarray, list[Tuned]]:
    """Return the group of every unit and the gains of every group, of the first number of groups that serves all.

    Where none does, it is the number that leaves the fewest units in groups for which one set of gains is not enough.
    """
    known: dict[tuple[str, ...], Tuned] = {}
    best: tuple[int, np.ndarray, list[Tuned]] | None = None
    for number in ways:
        labels, wanting = grouped(plants, seen, number, rng), 0
        tuned: list[Tuned] = []
        for k in range(int(labels.max()) + 1):
            own = [x for x, at, s in zip(plants, labels, seen, strict=True) if at == k and s]
            names = tuple(x.name for x in own)
            if names not in known:
                known[names] = tune(own)
            tuned.append(known[names])
            wanting += 0 if known[names].is_enough else int(np.sum(labels == k))
        if best is None or wanting < best[0]:
            best = wanting, labels, tuned
        if not wanting:
            break
    assert best is not None
    return best[1], best[2]


def _judged_all(
    found: FleetTuning, fleet: Opened, tuned: list[Tuned], settings: TuneSettings, *, only_these: bool
) -> FleetTuning:
    """Return a tuning with the figures of every unit, under the gains that it takes and under the nominal ones.

    Unless only these sets may be used, the nominal gains are one more: a unit that they serve best keeps them.
    """
    found.gains, found.unserved = tuned, dict(fleet.unserved)
    sets = tuned if only_these else [*tuned, Tuned(found.nominal, max(x.max_ms for x in tuned))]
    by_set = [figures(one.gains, fleet.plants, settings) for one in sets]
    theirs = figures(found.nominal, fleet.plants, settings)
    found.groups = [[] for _ in tuned]
    taken: list[list[tuple[UnitFigures, UnitFigures]]] = [[] for _ in (*sets, None)]
    for plant, told, nominal in zip(fleet.plants, zip(*by_set, strict=True), theirs, strict=True):
        k = serving_best(told, sets)
        own = None if only_these else better_own(plant, told[k], sets[k], nominal, settings)
        if own is not None:
            found.own[plant.name] = own[0]
        else:
            (found.groups[k] if k < len(tuned) else found.keeping).append(plant.name)
        taken[k if own is None else -1].append((told[k] if own is None else own[1], nominal))
    for one, pairs in zip((*sets, sets[-1]), taken, strict=True):
        found.ours += [a for a, _ in pairs]
        found.theirs += [b for _, b in pairs]
        found.unserved |= _unserved([a for a, _ in pairs], settings, one.max_ms)
    return found


def better_own(
    plant: UnitPlant, told: UnitFigures, best: Tuned, nominal: UnitFigures, settings: TuneSettings
) -> tuple[Gains, UnitFigures] | None:
    """Return gains for one unit alone where the best set does not serve it, or later than the nominal gains do."""
    if told.sensitivity_peak <= best.max_ms and _rests(told) and told.settling_s <= nominal.settling_s:
        return None
    own = own_gains(plant, settings, best.max_ms)
    return own if own is not None and serving_best((told, own[1]), (best, best)) == 1 else None


def serving_best(told: Sequence[UnitFigures], tuned: Sequence[Tuned]) -> int:
    """Return the set of gains for a unit: of those that keep its bound on Ms the one under which it settles soonest."""

    def order(k: int) -> tuple[bool, float, float]:
        return told[k].sensitivity_peak > tuned[k].max_ms, told[k].settling_s, told[k].sensitivity_peak

    return min(range(len(tuned)), key=order)


def _unserved(ours: Sequence[UnitFigures], settings: TuneSettings, max_ms: float) -> dict[str, str]:
    found: dict[str, str] = {}
    for x in ours:
        if x.sensitivity_peak > max_ms:
            found[x.unit] = f"Ms {x.sensitivity_peak:.3g}, more than {max_ms:.3g}"
        elif math.isinf(x.settling_s):
            found[x.unit] = f"does not settle within {settings.duration_s:g} s"
    return found


def rows_of(found: FleetTuning) -> list[list[str | float | None]]:
    """Return the table of the comparison on the units that no search saw."""
    rows: list[list[str | float | None]] = []
    for name, own in zip(("the units themselves", "nominal model, ±30 %"), judged(found), strict=True):
        peaks, settling = quantiles([x.sensitivity_peak for x in own]), quantiles([x.settling_s for x in own])
        overshoot = quantiles([x.overshoot_percent for x in own])
        at_rest = sum(_rests(x) for x in own)
        rows.append(
            [name, at_rest, peaks["median"], peaks["q95"], peaks["worst"], *_three(settling), overshoot["worst"]]
        )
    return rows


def judged(found: FleetTuning) -> tuple[list[UnitFigures], list[UnitFigures]]:
    """Return the figures under both sets of gains of the held-out units that at least one of them brings to rest."""
    aside = set(found.held_out)
    pairs = [
        (a, b) for a, b in zip(found.ours, found.theirs, strict=True) if a.unit in aside and (_rests(a) or _rests(b))
    ]
    return [a for a, _ in pairs], [b for _, b in pairs]


def _rests(told: UnitFigures) -> bool:
    return math.isfinite(told.sensitivity_peak) and math.isfinite(told.settling_s)


def _three(values: dict[str, float]) -> list[str | float]:
    return [x if math.isfinite(x) else "never" for x in (values["median"], values["q95"], values["worst"])]


SETS = "Each set was tuned on units alike in gain, lag and delay; a unit takes the one that serves it best."
KEEPING = "keep the nominal gains, which serve them best"
OWN = "have gains of their own (SIMC, from their gain, lag and delay): no set suits them as soon as the nominal gains"
COLUMNS = (
    "tuned on", "at rest", "Ms median", "Ms 95 %", "Ms worst", "settling median (s)", "settling 95 % (s)",
    "settling worst (s)", "overshoot worst (%)",
)  # fmt: skip


def _write(out: Path, found: FleetTuning, settings: TuneSettings, arguments: argparse.Namespace) -> None:
    for number, (gains, *_) in enumerate(found.gains, 1):
        name = "gains.toml" if len(found.gains) == 1 else f"gains-{number}.toml"
        write_gains(out / name, gains, settings.limits, settings.sampling.period_s)
    write_gains(out / "gains-nominal.toml", found.nominal, settings.limits, settings.sampling.period_s)
    for unit, gains in found.own.items():
        write_gains(out / f"gains-of-{folder_name(unit)}.toml", gains, settings.limits, settings.sampling.period_s)
    told = {
        "fleet": str(arguments.fleet),
        "nominal": arguments.nominal,
        "groups": [
            {"gains": asdict(gains), "max_ms": max_ms, "units": units}
            for (gains, max_ms, _), units in zip(found.gains, found.groups, strict=True)
        ],
        "nominal_gains": asdict(found.nominal),
        "keeping_nominal": found.keeping,
        "own_gains": {unit: asdict(gains) for unit, gains in found.own.items()},
        "held_out": found.held_out,
        "units": [
            {"unit": a.unit, "ours": _finite(a), "nominal": _finite(b)}
            for a, b in zip(found.ours, found.theirs, strict=True)
        ],
        "unserved": found.unserved,
    }
    write_result(out / TUNING, told)
    write_atomically(out / PAGE, render(_page(found, settings)))


def _finite(x: UnitFigures) -> dict[str, float | None]:
    values = {
        "sensitivity_peak": x.sensitivity_peak,
        "settling_s": x.settling_s,
        "overshoot_percent": x.overshoot_percent,
    }
    return {name: v if math.isfinite(v) else None for name, v in values.items()}


def _page(found: FleetTuning, settings: TuneSettings) -> Page:
    gains = [
        [k, len(units), g.proportional_V_per_um, g.integral_V_per_um_s, g.derivative_V_s_per_um]
        for k, ((g, *_), units) in enumerate(zip(found.gains, found.groups, strict=True), 1)
    ]
    sections = [
        Section(
            f"On {len(found.held_out)} units that no search saw",
            [
                f"Each unit with a latency of {settings.latency_frames} frames and of one more; the worse counts. "
                "Units that neither set of gains brings to rest are left out."
            ],
            Table(COLUMNS, rows_of(found), stressed=frozenset({0})),
        ),
        Section(
            "Gains", (), Table(("group", "units", "Kp (V/µm)", "Ki (V/(µm s))", "Kd (V s/µm)"), gains),
            remarks=[
                *([SETS] if len(gains) > 1 else []),
                *_others(found),
                *_relaxed_bounds(found, settings),
            ],
        ),
    ]  # fmt: skip
    if found.unserved:
        table = Table(("unit", "why"), list(found.unserved.items()))
        sections.append(Section(f"{len(found.unserved)} units that these gains do not serve", (), table))
    total = len(found.ours)
    lead = f"A step to {settings.setpoint_um:g} µm, tuned over the corrected models of {total} units."
    return Page("One controller for a fleet", lead, (), sections)


def _others(found: FleetTuning) -> list[str]:
    """Return a sentence about the units that keep the nominal gains, and one about those with gains of their own."""
    kinds = ((found.keeping, KEEPING), (list(found.own), OWN))
    return [f"{len(units)} unit{'s' * (len(units) > 1)} {what}: {_first(units)}." for units, what in kinds if units]


def _first(units: Sequence[str]) -> str:
    return ", ".join(units[:_TOLD]) + " ..." * (len(units) > _TOLD)


def _relaxed_bounds(found: FleetTuning, settings: TuneSettings) -> list[str]:
    """Return a sentence for every group whose bound on Ms gave way."""
    return [
        f"Group {k}: Ms is held to {x.max_ms:.3g}, since with {settings.max_ms:g} the slowest unit would settle later "
        "than under the nominal gains; --max-ms makes a bound firm."
        for k, x in enumerate(found.gains, 1)
        if x.max_ms > settings.max_ms
    ]


def _print(found: FleetTuning, settings: TuneSettings, out: Path) -> None:
    print_table(f"step to {settings.setpoint_um:g} µm, {len(found.held_out)} held-out units", COLUMNS, rows_of(found))
    for k, ((gains, *_), units) in enumerate(zip(found.gains, found.groups, strict=True), 1):
        sys.stdout.write(
            f"group {k}, {len(units)} units: Kp {gains.proportional_V_per_um:.4g} V/µm, "
            f"Ki {gains.integral_V_per_um_s:.4g} V/(µm s), Kd {gains.derivative_V_s_per_um:.4g} V s/µm\n"
        )
    sys.stdout.writelines(f"{line}\n" for line in (*_others(found), *_relaxed_bounds(found, settings)))
    if found.unserved:
        sys.stdout.write(f"{len(found.unserved)} units are not served: {_first(list(found.unserved))}\n")
    sys.stdout.write(f"written: {out}\n")
