"""What a loop needs to know of a plant: one voltage in, one displacement out."""

from typing import Protocol, runtime_checkable


class Plant(Protocol):
    """A single-input single-output plant that is stepped from outside.

    `step` holds `voltage_V` for `step_s` seconds and returns the displacement in um that its sensor reads at the
    end of that step, before the next voltage acts.
    """

    def reset(self) -> None:
        """Back to rest at t = 0, with the parameters that are set now."""
        ...

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance by `step_s` under the held `voltage_V`; returns displacement_um at the end of the step."""
        ...

    def close(self) -> None:
        """Release what the plant holds; it cannot be stepped afterwards."""
        ...


@runtime_checkable
class Readable(Protocol):
    """A plant that can also be read without being stepped."""

    def read(self) -> float:
        """The displacement in um that the sensor reads now."""
        ...


def restart(plant: Plant) -> float:
    """Reset `plant` and return what it reads at rest in um: its own reading if it is `Readable`, else 0."""
    plant.reset()
    return plant.read() if isinstance(plant, Readable) else 0.0
