"""One strong example of every effect, or several where its values decide how it is computed.

An effect that was added later has a file of its own here, with its examples and an oracle. The oracle of the effects in
the list below stands in `test_plant/test_effects.py`.
"""

import importlib
import pkgutil
from types import ModuleType
from typing import Any

FILES: dict[str, ModuleType] = {
    file.name: importlib.import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)
}
OWN_ORACLE: list[tuple[str, dict[str, Any]]] = [(name, x) for name, file in FILES.items() for x in file.PARAMETERS]
EXAMPLES: list[tuple[str, dict[str, Any]]] = [
    *OWN_ORACLE,
    ("supply_quantisation", {"step_V": 3.0}),
    ("transport_delay", {"delay_s": 0.0123}),
    ("transport_delay", {"delay_s": 0.3}),
    ("slew_limit", {"slew_rate_V_per_s": 5.0}),
    ("slew_limit", {"slew_rate_V_per_s": 700.0}),
    ("slew_limit", {"slew_rate_V_per_s": 20000.0}),
    ("supply_fall_lag", {"time_constant_s": 0.001}),
    ("supply_fall_lag", {"time_constant_s": 0.15}),
    ("source_resistance", {"time_constant_s": 0.0005}),
    ("source_resistance", {"time_constant_s": 1.0}),
    ("source_resistance", {"time_constant_s": 0.05, "second_share": 0.04}),
    ("dead_zone", {"threshold_V": 10.0}),
    ("charge_leakage", {"fraction": 0.6, "time_constant_s": 1.0}),
    ("saturation", {"scale_V": 30.0}),
    ("saturation", {"scale_V": 60.0, "form": "rational"}),
    ("saturation", {"scale_V": 30.0, "form": "knee", "sharpness": 1.5, "compression": 0.7}),
    ("electrostriction", {"coefficient_um_per_V2": 0.005}),
    ("electrostriction", {"coefficient_um_per_V2": 0.005, "bending_1_per_V2": 2e-4}),
    ("electrostriction", {"coefficient_um_per_V2": -0.005, "bending_1_per_V2": -1e-4}),
    ("rate_independent_hysteresis", {"thresholds_V": (2.0, 5.0, 12.0), "weights_um_per_V": (0.1, 0.1, 0.1)}),
    (
        "rate_independent_hysteresis",
        {
            "thresholds_V": (2.0, 12.0),
            "weights_um_per_V": (0.1, 0.05),
            "quadratic_um_per_V2": (0.002, -0.001),
            "cubic_um_per_V3": (1e-5, 2e-5),
            "reversible_quadratic_um_per_V2": 0.001,
            "reversible_cubic_um_per_V3": 1e-5,
        },
    ),
    (
        "rate_independent_hysteresis",
        {"thresholds_V": (2.0, 12.0), "weights_um_per_V": (0.1, 0.05), "reached_V": 20.0},
    ),
    (
        "rate_independent_hysteresis",
        {"form": "bouc_wen", "alpha_um_per_V": -0.3, "beta_1_per_V": 0.1, "gamma_1_per_V": 0.05},
    ),
    ("creep", {"gains": (0.2,), "time_constants_s": (0.1,)}),
    ("creep", {"gains": (0.05, 0.05, 0.05, 0.05), "time_constants_s": (0.1, 1.0, 10.0, 100.0)}),
    ("second_mode", {"share": 0.3}),
    ("tip_mass", {"frequency_ratio": 0.6}),
    ("structural_damping", {"damping_ratio": 0.001}),
    ("structural_damping", {"damping_ratio": 0.3}),
    ("stiffening", {"cubic_1_per_um2": 5e-4}),
    ("stiffening", {"cubic_1_per_um2": -3e-5}),
    ("stiffening", {"cubic_1_per_um2": 2e-4, "preload_um": 4.0}),
    ("stiffening", {"cubic_1_per_um2": 2e-4, "bending_1_per_um2": 1e-3}),
    ("stiffening", {"cubic_1_per_um2": 2e-4, "bending_1_per_um2": -4e-4}),
    ("backlash", {"half_width_um": 2.0}),
    ("ageing", {"loss": 0.5, "time_constant_s": 1.0}),
    ("ageing", {"loss": 0.5, "time_constant_s": 1.0, "exponent": 2.0}),
    ("thermal_drift", {"amplitude_um": 5.0, "time_constant_s": 0.5}),
    ("thermal_drift", {"amplitude_um": 5.0, "time_constant_s": 0.5, "exponent": 0.5}),
    ("periodic_disturbance", {"sine_um": 3.0, "cosine_um": 1.0, "frequency_Hz": 50.0}),
    ("sensor_lag", {"time_constant_s": 0.0005}),
    ("sensor_lag", {"time_constant_s": 0.1}),
    ("sensor_lag", {"time_constant_s": 0.04, "second_share": 0.05}),
    ("lens_distortion", {"quadratic_1_per_um": 0.01, "cubic_1_per_um2": 1e-4}),
    ("lens_distortion", {"quartic_1_per_um3": 1e-5, "quintic_1_per_um4": -1e-7}),
    ("sensor_quantisation", {"step_um": 0.7}),
]
