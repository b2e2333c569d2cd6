"""Table 1, and what equations (2), (3) and (10) to (12) make of it."""

import math
from pathlib import Path

from bender_plant.composite_beam import (
    CompositeBeam,
    flexural_rigidity_N_m2,
    mass_per_length_kg_per_m,
    moment_coefficient_N_m_per_V,
    natural_frequency_Hz,
    static_gain_um_per_V,
    static_share,
    wave_number,
)
from bender_studies.reproduction.exhibit import Exhibit, Row
from bender_studies.reproduction.printed import FIRST_ROOT, TABLE_1, TIME_STEP_S
from bender_studies.reproduction.shared_work import SharedWork

FILM_PF_PER_CM2 = 380.0
"""Of PVDF film of 28 um, data sheet (TE Connectivity, Piezo Film Sensors Technical Manual, table of capacitances)."""
RUNGE_KUTTA_BOUND = 2.0 * math.sqrt(2.0)
"""Classical Runge-Kutta is stable on the imaginary axis up to this angular frequency times step."""

_PARAMETERS = (
    ("length L", "m", "length", "beam.length", 1.0),
    ("width W", "m", "width", "beam.width", 1.0),
    ("piezoelectric coefficient d31", "C/N", "d31", "beam.layer[2].piezoelectric_coefficient", 1.0),
    ("PVDF modulus Ea", "Pa", "pvdf_modulus", "beam.layer[2].young_modulus", 1.0),
    ("PVDF density", "kg/m³", "pvdf_density", "beam.layer[2].density", 1.0),
    ("PVDF thickness ha", "µm", "pvdf_thickness", "beam.layer[2].thickness", 1e6),
    ("polyimide modulus Em", "Pa", "polyimide_modulus", "beam.layer[1].young_modulus", 1.0),
    ("polyimide density", "kg/m³", "polyimide_density", "beam.layer[1].density", 1.0),
    ("polyimide thickness hm", "µm", "polyimide_thickness", "beam.layer[1].thickness", 1e6),
)
"""Name, unit, key of the printed value, FMI name, factor from the FMU's unit."""


def show(shared: SharedWork) -> Exhibit:
    """Table 1 as the FMU carries it, and the beam that follows from it."""
    beam = shared.paper_model.beam
    if beam is None:
        raise ValueError("the model paper has no beam, expected that of Table 1")
    printed = CompositeBeam(beam.layers, beam.length_m, beam.width_m, neutral_axis="paper")
    starts = start_values(shared.fmus["paper"])
    parameters = [
        Row(name, unit, TABLE_1[key], starts[fmi_name] * factor, starts[fmi_name] * factor, given=True)
        for name, unit, key, fmi_name, factor in _PARAMETERS
    ]
    gain, true_gain = static_gain_um_per_V(printed), static_gain_um_per_V(beam)
    return Exhibit(
        name="Table 1",
        finding=f"Table 1 gives {true_gain:.3g} µm/V, or {gain:.3g} with the paper's neutral axis; neither is 0.473",
        paper_mode_is="the parameters as the FMU of the model paper declares them, and the paper's formulas",
        ours_is="the same parameters, and the beam about its own neutral axis (classical laminate theory)",
        rows=[*parameters, _capacitance(beam), *_derived(printed, beam)],
    )


def start_values(fmu: Path) -> dict[str, float]:
    """The start values of an FMU's Real variables by their names."""
    import fmpy

    variables = fmpy.read_model_description(str(fmu)).modelVariables
    return {v.name: float(v.start) for v in variables if v.type == "Real" and v.start is not None}


def printed_bounds_share(beam: CompositeBeam) -> float:
    """The integral (2) with its printed bounds over the closed form (3) that the paper gives for it."""
    substrate, film = beam.layers[0].thickness_m, beam.layers[1].thickness_m
    lower, upper = substrate / 2.0, film / 2.0 + substrate / 2.0
    lever_area = 0.5 * (upper**2 - lower**2)
    return (lever_area / film) / (0.5 * (film + substrate))


def printed_mode_at_clamp(mode: int) -> float:
    """Equation (10) at x = 0 over L as printed, with sin(lambda L) where sin(lambda x) should stand."""
    beta = wave_number(mode)
    ratio = (math.cos(beta) + math.cosh(beta)) / (math.sin(beta) + math.sinh(beta))
    return ratio * math.sin(beta)


def _capacitance(beam: CompositeBeam) -> Row:
    area_cm2 = 1e4 * beam.length_m * beam.width_m
    return Row(
        "PVDF capacitance Cp", "F", TABLE_1["capacitance"], None, FILM_PF_PER_CM2 * 1e-12 * area_cm2,
        "Cp: the paper's value belongs to a film of almost twice this area: L and W of Table 1 with 380 pF/cm², the "
        "data sheet's value for film of 28 µm, give ours; no equation of the paper uses it",
    )  # fmt: skip


def _derived(printed: CompositeBeam, beam: CompositeBeam) -> list[Row]:
    moment, true_moment = moment_coefficient_N_m_per_V(printed), moment_coefficient_N_m_per_V(beam)
    rigidity = flexural_rigidity_N_m2(printed)
    literal_rad_per_s = float(FIRST_ROOT.text) ** 2 * math.sqrt(rigidity / mass_per_length_kg_per_m(printed))
    frequency, true_frequency = natural_frequency_Hz(printed, 1), natural_frequency_Hz(beam, 1)
    step_s = float(TIME_STEP_S.text)
    return [
        Row("first root of (11)", "", FIRST_ROOT, wave_number(1), wave_number(1)),
        Row("EI", "N m²", None, rigidity, flexural_rigidity_N_m2(beam),
            "EI: the paper takes it about the middle of the substrate, about which the beam does not bend"),
        Row("Ca by (3)", "N m/V", None, moment, true_moment,
            "Ca: its lever is taken from the middle of the substrate instead of the neutral axis"),
        Row("Ca by the printed bounds of (2)", "N m/V", None, printed_bounds_share(beam) * moment, true_moment,
            f"the printed bounds of (2) end in the middle of the film and give {printed_bounds_share(beam):.3f} of the "
            "(3) that follows it"),
        Row("static tip displacement", "µm/V", None, static_gain_um_per_V(printed), static_gain_um_per_V(beam)),
        Row("first frequency, (12) to the letter", "rad/s", None, literal_rad_per_s, 2.0 * math.pi * true_frequency,
            "(12) to the letter: the root 1.875 is that of λL; put into (12) as λ, as the paper says, it makes the "
            "beam thousands of times too slow"),
        Row("first frequency, λ = 1.875/L", "Hz", None, frequency, true_frequency),
        Row("first mode (10) at the clamp, over L", "", None, printed_mode_at_clamp(1), 0.0,
            "(10) ends with sin(λL) where sin(λx) must stand, so its modes move at the clamp, against (5)"),
        Row("share of the first mode", "%", None, 100.0, 100.0 * static_share(1),
            "share of the first mode: with one mode alone, the static deflection of the beam is short by the rest"),
        Row("ω₁ times the time step", "rad", None, 2.0 * math.pi * frequency * step_s,
            2.0 * math.pi * true_frequency * step_s,
            f"ω₁ times the time step: an explicit Runge-Kutta step is stable up to {RUNGE_KUTTA_BOUND:.2f}: with "
            f"{TIME_STEP_S.text} s the undamped mode (14) runs away in it; the FMU discretises its modes exactly, "
            "whatever the step"),
    ]  # fmt: skip
