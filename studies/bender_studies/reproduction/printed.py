"""What the paper prints; these are the only numbers here that no run computes.

M. Musa and U. Wejinya, Data-Driven Hysteresis Modeling and Optimized PID Control for A Piezoelectric Bending
Microactuator, 2024. Places are named by the nearest heading, figure or equation.
"""

from bender_studies.reproduction.exhibit import Printed

_TABLE, _BOUC_WEN, _EQUATION_30 = "Table 1", "Simulation Validation of SINDy, beside Figure 4", "equation (30)"
_FIGURE_8, _FIGURE_10 = "Model Verification, beside Figure 8", "Simulation Analysis, beside Figure 10"
_FIGURE_9, _FIGURE_11 = "Simulation Analysis, beside Figure 9", "Experimental Analysis, beside Figure 11"

TABLE_1 = {
    "length": Printed("0.0125", _TABLE),
    "width": Printed("0.01", _TABLE),
    "capacitance": Printed("0.88e-9", _TABLE),
    "d31": Printed("23e-12", _TABLE),
    "pvdf_modulus": Printed("2.7e9", _TABLE),
    "pvdf_density": Printed("1.78e3", _TABLE),
    "pvdf_thickness": Printed("28", _TABLE),
    "polyimide_modulus": Printed("2.5e9", _TABLE),
    "polyimide_density": Printed("1.42e3", _TABLE),
    "polyimide_thickness": Printed("50", _TABLE),
}
FIRST_ROOT = Printed("1.875", "below equation (11)")

BOUC_WEN = {"u'": Printed("10", _BOUC_WEN), "w |u'|": Printed("0.75", _BOUC_WEN), "|w| u'": Printed("0.5", _BOUC_WEN)}
"""Alpha, beta and gamma, by the term that they multiply (beta and gamma with a minus sign)."""
SIMULATED_ERROR_PERCENT = Printed("2.74e-6", _BOUC_WEN)
FRAMES_PER_S = Printed("30", "Experimental SINDy Hysteresis Modeling, beside Figure 5")
EXPERIMENTAL_ERROR_PERCENT = Printed("0.95", "Experimental SINDy Hysteresis Modeling, beside Figure 6")
COEFFICIENTS = {
    "w": Printed("-0.48", _EQUATION_30),
    "u": Printed("1.652", _EQUATION_30),
    "u'": Printed("0.818", _EQUATION_30),
    "|w|": Printed("-0.22", _EQUATION_30),
    "w |w|": Printed("-0.124", _EQUATION_30),
}
"""Of equation (30), by the term that they multiply; the paper writes y for the displacement w on the right."""

SENSITIVITY_UM_PER_V = Printed("0.473", _FIGURE_8)
R_SQUARED = {"up": Printed("0.99", _FIGURE_8), "down": Printed("0.98", _FIGURE_8)}

CONVERGED_ITERATIONS = Printed("30", _FIGURE_9)
SIMULATED_TIME_S = Printed("2", _FIGURE_9)
TIME_STEP_S = Printed("0.01", _FIGURE_9)

BAS_STEP = {
    "rise": Printed("0.88", _FIGURE_10),
    "settling": Printed("1.74", _FIGURE_10),
    "overshoot": Printed("no", _FIGURE_10),
}
ZN_STEP = {
    "rise": Printed("0.96", _FIGURE_10),
    "settling": Printed("3.82", _FIGURE_10),
    "overshoot": Printed("5.7", _FIGURE_10),
}
BAS_ON_THE_BENCH = Printed("little to no overshoot", _FIGURE_11)
ZN_ON_THE_BENCH = Printed("large initial oscillations", _FIGURE_11)
