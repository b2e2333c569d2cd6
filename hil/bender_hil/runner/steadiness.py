"""How steadily readings come at rest, before anything is switched on, and the limits that follow from it.

Two limits depend on the machine more than on the bench: the age of the newest reading and the silence of the
controller. Where the bench file leaves them open they follow from what the loop itself would have seen at rest. They
are never below their defaults, and never above a ceiling that safety sets: what needs more is refused.
"""

import contextlib
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

from bender_hil.bench_file import BenchFile
from bender_hil.guard.settings import GuardSettings
from bender_hil.runner.tip_camera import Eyes
from bender_loop.errors import InputError

WATCHED_S, FEWEST, LONGEST_S = 1.5, 15, 10.0
"""So long readings are watched, longer for so many of them, but no longer than the last."""
TIMES = 3
"""So often they are watched before a run is refused."""
SPREAD = 4.0
"""A run has many more readings than are watched: the worst of them lies so many times as far from the usual one."""
LARGEST_S = 0.5
"""Of any such limit: off or alarm within `shutdown_limit_s` + 1 s of a fault leaves as much for the guard itself."""
_OPENING_S = 0.3
"""What comes so soon may have waited while the sensor was opened."""
_PATIENCE_S = 0.02


class UnsteadyError(InputError):
    """Readings come too irregularly for any limit that is safe; nothing was switched on."""


class NoReadingsError(UnsteadyError):
    """Hardly any reading came; nothing was switched on."""


@dataclass(frozen=True, slots=True)
class Steadiness:
    """What the loop would have seen at rest.

    Attributes:
        readings: that came.
        usual_age_s, largest_age_s: of the newest reading when the next one was worked out: median and maximum.
        usual_silence_s, largest_silence_s: between two turns of the loop, the same.
    """

    readings: int
    usual_age_s: float
    largest_age_s: float
    usual_silence_s: float
    largest_silence_s: float

    def needed_s(self, name: str) -> float:
        """Return what a run needs of `frame_age_s` or `heartbeat_s`."""
        usual_s, largest_s = self._seen_s(name)
        return usual_s + SPREAD * (largest_s - usual_s)

    def largest_s(self, name: str) -> float:
        """Return the largest of what was seen."""
        return self._seen_s(name)[1]

    def _seen_s(self, name: str) -> tuple[float, float]:
        if name == "frame_age_s":
            return self.usual_age_s, self.largest_age_s
        return self.usual_silence_s, self.largest_silence_s


def watched_at_rest(eyes: Eyes, fewest: int = FEWEST, *, clock: Callable[[], float] = time.perf_counter) -> Steadiness:
    """Take readings as the loop would, and forget them.

    Args:
        eyes: open.
        fewest: ages that are wanted; 0 where the limit of the age is given.
        clock: of the readings.

    Raises:
        NoReadingsError: not even two readings came.
    """
    ages_s: list[float] = []
    silences_s: list[float] = []
    start_s = before_s = clock()
    newest_s: float | None = None
    seen = 0
    # a machine that is held up in the first turn has shown nothing of the others, however much time has passed
    while (passed_s := before_s - start_s) < WATCHED_S or (
        (len(ages_s) < fewest or len(silences_s) < FEWEST) and (passed_s < LONGEST_S or not silences_s)
    ):
        sight = eyes.look(_PATIENCE_S)
        now_s = clock()
        if passed_s > _OPENING_S:
            silences_s.append(now_s - before_s)
        if sight is not None:
            seen += 1
            if newest_s is not None and passed_s > _OPENING_S:
                ages_s.append(now_s - newest_s)
            newest_s = sight.grabbed_s
        before_s = now_s
    if fewest and not ages_s:
        why = eyes.why_nothing() or "is it connected?"
        raise NoReadingsError(
            f"the sensor gave {seen} readings in {LONGEST_S:g} s at rest: {why} Nothing was switched on"
        )
    return Steadiness(
        len(ages_s),
        statistics.median(ages_s or [0.0]),
        max(ages_s, default=0.0),
        statistics.median(silences_s),
        max(silences_s),
    )


def ceiling_s(limits: GuardSettings) -> float:
    """Return the largest limit that may follow from a sensor.

    The measured voltage and current are judged as late as that, and the way down may take longer.
    """
    return min(limits.settle_s, limits.shutdown_limit_s, LARGEST_S)


def steadied(bench: BenchFile, seen: Steadiness) -> BenchFile:
    """Return the bench with the limits that its file leaves to the sensor.

    Raises:
        UnsteadyError: a limit would have to be larger than is safe, or than the file says.
    """
    guard = bench.guard
    for name in ("frame_age_s", "heartbeat_s"):
        given_s = getattr(guard, name)
        if name in bench.follows_sensor:
            needed_s, most_s = seen.needed_s(name), max(given_s, ceiling_s(guard))
            if needed_s > most_s:
                raise UnsteadyError(_refusal(name, seen, f"a run would need {_ms(needed_s)}, safe are {_ms(most_s)}"))
            guard = replace(guard, **{name: max(given_s, needed_s)})
        elif seen.largest_s(name) > given_s:
            raise UnsteadyError(_refusal(name, seen, f"guard.{name} allows {_ms(given_s)}"))
    return replace(bench, guard=guard)


def steadied_at_rest(bench: BenchFile, eyes: Eyes) -> tuple[BenchFile, Steadiness]:
    """Return the bench with the limits that follow from readings at rest, and what these were.

    One hold-up of the machine is no reason to refuse a run: readings that are too irregular are watched again.

    Raises:
        UnsteadyError: they were so every time, or hardly any came.
    """
    fewest = FEWEST if "frame_age_s" in bench.follows_sensor else 0
    for _ in range(TIMES - 1):
        seen = watched_at_rest(eyes, fewest)
        with contextlib.suppress(UnsteadyError):
            return steadied(bench, seen), seen
    seen = watched_at_rest(eyes, fewest)
    return steadied(bench, seen), seen


def limits_sentence(seen: Steadiness, limits: GuardSettings) -> str:
    """Return what was seen at rest and what the guard allows, as a line."""
    return (
        f"at rest the newest reading is up to {_ms(seen.largest_age_s)} old (usually {_ms(seen.usual_age_s)}), the "
        f"controller silent for up to {_ms(seen.largest_silence_s)}; the guard ends the run at "
        f"{_ms(limits.frame_age_s)} and {_ms(limits.heartbeat_s)}"
    )


def facts(seen: Steadiness, limits: GuardSettings) -> dict[str, Any]:
    """Return the same for the log."""
    return asdict(seen) | {"frame_age_s": limits.frame_age_s, "heartbeat_s": limits.heartbeat_s}


def _refusal(name: str, seen: Steadiness, why: str) -> str:
    what = "the newest reading was" if name == "frame_age_s" else "the controller was silent for"
    old = " old" if name == "frame_age_s" else ""
    return (
        f"readings come too irregularly: at rest {what} up to {_ms(seen.largest_s(name))}{old}, {why}; close what "
        f"keeps this machine busy and try again, or set guard.{name} yourself. Nothing was switched on"
    )


def _ms(time_s: float) -> str:
    return f"{1e3 * time_s:.0f} ms"
