"""The arguments of `bender fleet tune`; costs nothing to import."""

import argparse
from pathlib import Path

DEFAULT_EVALUATIONS, DEFAULT_DURATION_S, MOST_GROUPS, MOST_UNASKED = 150, 4.0, 12, 6


def add_tune_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the fleet, the loop, the search and where the results go."""
    parser.add_argument("fleet", type=Path, metavar="DIR", help="output directory of bender fleet diagnose")
    parser.add_argument("--setpoint", type=float, default=10.0, metavar="UM", help="height of the step (default: 10)")
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="frames per second (default: 30)")
    parser.add_argument("--latency", type=int, default=1, metavar="FRAMES", help="age of a frame (default: 1)")
    parser.add_argument(
        "--duration",
        type=float,
        default=DEFAULT_DURATION_S,
        metavar="S",
        help="in which a unit has to settle; it has to rest for as long again (default: 4)",
    )
    parser.add_argument(
        "--voltage-limits",
        nargs=2,
        type=float,
        default=(0.0, 50.0),
        metavar=("LOW", "HIGH"),
        help="of the command (default: 0 50)",
    )
    parser.add_argument(
        "--max-ms",
        type=float,
        metavar="MS",
        help="firm bound over all units of a group (default: 1.7, or as little more as lets the slowest unit settle "
        "sooner than under the nominal gains)",
    )
    parser.add_argument(
        "--groups",
        type=int,
        metavar="K",
        help="sets of gains, each for units alike (default: as many as are needed for the bound, at most "
        f"{MOST_UNASKED})",
    )
    parser.add_argument(
        "--held-out", type=float, default=0.5, metavar="SHARE", help="of the units, for judging alone (default: 0.5)"
    )
    parser.add_argument(
        "--evaluations", type=int, default=DEFAULT_EVALUATIONS, metavar="N", help="of each search (default: 150)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the search and of the units held out (default: 0)"
    )
    parser.add_argument("--nominal", default="paper", metavar="MODEL", help="to compare with (default: paper)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: DIR/tune, with a number where it exists")
