"""The exhibits in the order of the paper."""

from collections.abc import Callable, Mapping
from importlib import import_module

from bender_studies.reproduction.exhibit import Exhibit
from bender_studies.reproduction.shared_work import SharedWork

EXHIBITS: Mapping[str, str] = {
    "Table 1": "table_1",
    "Figure 4": "figure_4",
    "Figure 5": "figure_5",
    "Figure 6": "figure_6",
    "Equation (30)": "equation_30",
    "Figure 8": "figure_8",
    "Figure 9": "figure_9",
    "Figure 10": "figure_10",
    "Figure 11": "figure_11",
}
"""What the paper calls it, and the module here that shows it."""

Show = Callable[[SharedWork], Exhibit]


def show_of(name: str) -> Show:
    """The function that computes an exhibit."""
    return import_module(f"{__package__}.exhibits.{EXHIBITS[name]}").show
