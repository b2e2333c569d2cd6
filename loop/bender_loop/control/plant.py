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


@runtime_checkable
class SavablePlant(Plant, Readable, Protocol):
    """A plant whose whole state can be kept and come back to, any number of times."""

    def save(self) -> object:
        """Return what the plant remembers now, its time included; it stays good whatever the plant does next."""
        ...

    def restore(self, state: object) -> None:
        """Go back to what `save` of this plant returned."""
        ...


@runtime_checkable
class Timed(Protocol):
    """A plant that has to know at what time of a record its clock begins: its further inputs follow that."""

    def begin_at(self, time_s: float) -> None:
        """Set the time of the record at which the next reset begins."""
        ...


def restart(plant: Plant, at_s: float = 0.0) -> float:
    """Reset `plant` and return what it reads at rest in um: its own reading if it is `Readable`, else 0.

    Args:
        plant: to reset.
        at_s: the time of the record at which it begins.
    """
    if isinstance(plant, Timed):
        plant.begin_at(at_s)
    plant.reset()
    return plant.read() if isinstance(plant, Readable) else 0.0
