"""What the results say, in sections of a page. Every figure in a sentence is taken from a result."""

import math
from collections.abc import Sequence

from bender_loop.control.metrics import has_settled
from bender_loop.shell.progress import Cell
from bender_report.page import Card, Page, Picture, Section, Table
from bender_studies.demonstration.bench_story import in_two_widths
from bender_studies.demonstration.steps import PAPER_STEPS, Overlaid, Race
from bender_tuner.pictures.convergence import convergence_figure
from bender_tuner.pictures.robustness import monte_carlo_figure
from bender_tuner.pictures.steps import duration_in_words, steps_figure
from bender_tuner.results.summary import finding_lines, gain_lines
from bender_tuner.task.contenders import Contender
from bender_tuner.task.judgement import Judgement
from bender_tuner.task.session import Session

COLUMNS = ("controller", "rise (s)", "settling (s)", "overshoot (%)", "worst Ms", "unstable plants")


def summary_rows(session: Session) -> list[list[Cell]]:
    """Our contenders, then the paper's two loops, for which it gives no robustness."""
    run_s = session.settings.duration_s
    ours = [_row(contender, run_s) for contender in session.contenders if contender.kind != "start"]
    paper: list[list[Cell]] = [[f"paper, {name}", *figures, None, None] for name, figures in PAPER_STEPS.items()]
    return [*ours, *paper]


def tell(session: Session, race: Race, overlaid: Overlaid, bench: Section) -> Page:
    """The whole page; `bench` tells of the runs on the emulated bench."""
    settings, m = session.settings, _tuned(session).metrics
    return Page(
        title="A piezo bending actuator: tuned in simulation, run on an emulated bench",
        lead=f"In simulation: {settings.evaluations} evaluations of a beetle search through the FMU gave a controller "
        f"that takes the tip to {settings.setpoint_um:g} µm in {_seconds(m.settling_time_s)} with "
        f"{m.overshoot_percent:.1f} % overshoot, behind a camera of {settings.rate_Hz:g} Hz whose frames come late and "
        f"a supply that takes 20 ms to follow. {bench.heading}.",
        cards=_cards(session),
        sections=[
            bench,
            step_section(session),
            robustness_section(session),
            convergence_section(session),
            race_section(race),
            overlay_section(overlaid),
            gains_section(session),
        ],
    )


def step_section(session: Session) -> Section:
    """Step responses and the table with the paper's figures."""
    tuned, settling = _tuned(session), PAPER_STEPS["BAS-PID"][1]
    marks = {f"settled in the paper: {settling} s": settling}
    simc = next((c.judgement for c in session.contenders if c.method == "simc"), None)
    share = "" if simc is None else _beside_simc(tuned.practitioner.value, simc.practitioner.value)
    return Section(
        f"In simulation a step of {session.settings.setpoint_um:g} µm settles in "
        f"{_seconds(tuned.metrics.settling_time_s)}, in the paper in {settling} s",
        [
            "Each controller sees what the camera sees: blurred by its exposure, 30 times a second, one frame late. "
            "The curves show the tip itself, between the frames too." + share
        ],
        Table(COLUMNS, summary_rows(session), stressed=frozenset({0})),
        in_two_widths(
            "steps",
            "Step responses of all controllers with their command voltages below",
            lambda narrow: steps_figure(session.contenders, session.settings, marks, narrow),
        ),
        [
            "The paper's loop was simulated on its own model, in steps of 10 ms and without delay, so its figures "
            "stand beside ours for orientation. Its ZN-PID settles later than the 2 s that were simulated: taken as "
            "printed."
        ],
    )


def robustness_section(session: Session) -> Section:
    """Monte Carlo."""
    tuned, result = _tuned(session).practitioner, session.contenders[0].monte_carlo
    if result is None:
        return Section("Other actuators", ["Monte Carlo was left out."])
    tried = [c for c in session.contenders if c.monte_carlo]
    count, worst = len(result.outcomes), tuned.worst_sensitivity_peak
    bound = session.problem.practitioner.priorities.sensitivity_bound
    return Section(
        f"In simulation, the same gains on {count} other actuators: {result.unstable or 'none'} unstable",
        [
            "No two actuators are alike. Gain ± 30 %, one or two frames of latency, a supply of 10 to 100 ms, the "
            "first resonance 20 % lower to 40 % higher, its damping ratio 0.01 to 0.08, and noise: drawn at random, "
            "the same plants for every controller.",
            f"Over gain and latency the worst sensitivity peak Ms is {worst:.2f} (bound {bound:g}): the Nyquist curve "
            f"stays {1 / worst:.2f} away from the critical point.",
        ],
        picture=in_two_widths(
            "plants",
            "Share of plants that have settled over time, one curve for each controller",
            lambda narrow: monte_carlo_figure(tried, 2.0 * session.settings.duration_s, narrow),
        ),
    )


def convergence_section(session: Session) -> Section:
    """The paper's Fig. 9, ours."""
    return Section(
        "How the beetle got there",
        [
            "Reliable BAS keeps the beetle's antennae and leaves less to luck: a frame of headings, an antenna of its "
            "own for each, a step to the vertex of the parabola. Gains are searched on a logarithmic scale, because "
            "the good ones lie decades apart. Once it has arrived, another beetle looks elsewhere."
        ],
        picture=in_two_widths(
            "convergence",
            "The three gains and the objective over the evaluations",
            lambda narrow: convergence_figure(session.searches[:1], session.settings.objective, narrow),
        ),
    )


def race_section(race: Race) -> Section:
    """The printed sign."""
    printed, right, ours = (race.median_best(method) for method in ("bas_printed", "bas", "reliable_bas"))
    return Section(
        f"As printed, the search ends {printed / ours:.0f} times above ours",
        [
            "Equation (25) of the paper steps towards the antenna with the larger error, while its Algorithm 1 keeps "
            f"the smaller one. Run to the letter it ends at a median of {printed:.3g} µm²; with the sign corrected, "
            f"in a normalised box, at {right:.3g}; ours at {ours:.3g}."
        ],
        picture=Picture(race.picture, "Best mean squared error over the evaluations for three forms of the search"),
        remarks=[
            "The mean squared error looks at the frames alone and asks for nothing but a small error: no margin, no "
            "calm between the frames. The tuning above minimises something else for that reason."
        ],
    )


def overlay_section(overlaid: Overlaid) -> Section:
    """The model over a record."""
    c = overlaid.comparison
    line = f"gain × {c.recalibration.gain:.3g}, offset {c.recalibration.offset_um:+.2f} µm"
    if overlaid.is_measured:
        floor_um = overlaid.quantum_um / math.sqrt(12.0)
        clearly = "" if c.recalibrated.rms_um > 2.0 * floor_um else "not clearly "
        heading = f"The model misses the paper's own measurement by {c.before.rms_um:.1f} µm"
        says = (
            f"Equation (30), learned at ± 10 V, over the actuator of the paper as it was measured up to 50 V. With its "
            f"reading recalibrated ({line}) the residual is {c.recalibrated.rms_um:.1f} µm. The camera reads in steps "
            f"of {overlaid.quantum_um:.2f} µm, which accounts for {floor_um:.2f} µm: the rest is {clearly}in the "
            "model, and its shape over the voltage stands in the lower right panel."
        )
    else:
        heading = f"A wrong gain and offset are found again: {c.recalibrated.rms_um:.2f} µm of residual"
        says = (
            "A staircase recorded on an emulated actuator whose gain is 0.93 of the model's, with an offset of 0.4 µm "
            f"and 0.15 µm of noise. As given, the model misses it by {c.before.rms_um:.2f} µm rms; recalibration finds "
            f"{line}."
        )
    return Section(
        heading,
        [says],
        picture=Picture(overlaid.picture, "Measured and simulated displacement, and the residual"),
        code="bender compare RECORD --untimed" if overlaid.is_measured else "bender compare RECORD --model bench",
    )


def gains_section(session: Session) -> Section:
    """The gains, and how to do it again."""
    gains, settings = session.contenders[0].gains, session.settings
    lines = [] if gains is None else list(gain_lines(gains, settings.rate_Hz))
    findings = finding_lines(
        session.contenders, session.problem.practitioner.priorities, session.rule, session.problem.notes
    )
    again = f"bender tune --model bench --seed {settings.seed} --monte-carlo {settings.monte_carlo}"
    return Section(
        "The gains, and how to tune again",
        [_sentence(finding) for finding in findings],
        code="\n".join([*lines, "", again]),
    )


def _cards(session: Session) -> Sequence[Card]:
    rise, settling, overshoot = PAPER_STEPS["BAS-PID"]
    tuned, result = _tuned(session), session.contenders[0].monte_carlo
    m, bound = tuned.metrics, session.problem.practitioner.priorities.sensitivity_bound
    cards = [
        Card(_seconds(m.rise_time_s), "rise time, simulated", f"paper: {rise} s"),
        Card(_seconds(m.settling_time_s), "settling time, 2 %, simulated", f"paper: {settling} s"),
        Card(f"{m.overshoot_percent:.1f} %", "overshoot, simulated", f"paper: {overshoot:g} %"),
        Card(
            f"{tuned.practitioner.worst_sensitivity_peak:.2f}",
            "worst sensitivity peak Ms, simulated",
            f"bound: {bound:g}",
        ),
    ]
    if result is not None:
        cards.append(
            Card(f"{result.unstable} of {len(result.outcomes)}", "other plants unstable, simulated", "paper: not given")
        )
    return cards


def _beside_simc(ours: float, simc: float) -> str:
    change = 100.0 * (1.0 - ours / simc)
    side = "better" if change >= 0.0 else "worse"
    return (
        f" By the practitioner's objective the tuned gains are {abs(change):.0f} % {side} than SIMC's closed formula."
    )


def _seconds(duration_s: float) -> str:
    return "never" if math.isnan(duration_s) else duration_in_words(duration_s)


def _sentence(line: str) -> str:
    return f"{line[:1].upper()}{line[1:]}."


def _row(contender: Contender, run_s: float) -> list[Cell]:
    if contender.judgement is None:
        return [contender.label, *[None] * (len(COLUMNS) - 1)]
    m, worst = contender.judgement.metrics, contender.judgement.practitioner.worst_sensitivity_peak
    result = contender.monte_carlo
    return [
        contender.label,
        None if math.isnan(m.rise_time_s) else round(m.rise_time_s, 3),
        round(m.settling_time_s, 3) if has_settled(m.settling_time_s, run_s) else f"not within {run_s:g} s",
        round(m.overshoot_percent, 1),
        f"{worst:.2f}" if math.isfinite(worst) else "unstable",
        None if result is None else f"{result.unstable} of {len(result.outcomes)}",
    ]


def _tuned(session: Session) -> Judgement:
    judgement = session.contenders[0].judgement
    if judgement is None:
        raise ValueError("the tuned gains were not judged, there is nothing to tell")
    return judgement
