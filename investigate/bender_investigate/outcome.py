"""How an investigation ended: `investigation.json`, and the lines that are printed."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_investigate.proof import Comparison
from bender_loop.shell.files import finite, write_atomically

OUTCOME = "investigation.json"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an investigation found.

    Attributes:
        verdict: of the last diagnosis; None where there was none.
        sentence: that verdict in a sentence.
        effects: ids of those in the corrected model.
        complete: nothing above the noise is left unexplained.
        ended: why it went no further: "verdict", "budget", "no experiment" or "experiments".
        why: the same in a sentence.
        lead: an equation for the residual of an unexplained gap, in words.
        bench_s: bench time until the verdict stood.
        total_s: bench time of everything.
        plays: on the bench until the verdict stood.
        comparison: of old and new gains; None where they were not compared.
        no_comparison: why not.
        diagnosis: folder of the last one.
        gains: file of the gains to use from now on; None for the old ones.
    """

    verdict: str | None
    sentence: str
    effects: tuple[str, ...]
    complete: bool
    ended: str
    why: str
    lead: str | None
    bench_s: float
    total_s: float
    plays: int
    comparison: Comparison | None
    no_comparison: str | None
    diagnosis: str | None
    gains: str | None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `investigation.json`."""
        return finite(
            {
                "verdict": self.verdict,
                "sentence": self.sentence,
                "effects": list(self.effects),
                "complete": self.complete,
                "ended": {"by": self.ended, "why": self.why},
                "lead": self.lead,
                "bench_s": {"until_the_verdict": self.bench_s, "all": self.total_s},
                "plays_until_the_verdict": self.plays,
                "gains": {
                    "compared": None if self.comparison is None else self.comparison.to_dict(),
                    "not_compared": self.no_comparison,
                    "use": self.gains,
                },
                "diagnosis": self.diagnosis,
            }
        )

    def lines(self) -> list[str]:
        """Return what is printed at the end."""
        gains = self.comparison.sentence if self.comparison is not None else f"gains: {self.no_comparison}"
        return [
            f"{self.verdict or 'no verdict'}: {self.sentence}",
            *([f"lead: {self.lead}"] if self.lead else []),
            f"bench time: {self.bench_s:.0f} s until the verdict, {self.total_s:.0f} s in all; {self.why}",
            gains,
        ]

    def write(self, out: Path) -> None:
        """Write `investigation.json`."""
        text = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
        write_atomically(out / OUTCOME, text + "\n")
