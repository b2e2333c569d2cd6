"""A state whose length follows from the parameters of a block."""


def of_any_length(values: list[float]) -> tuple[float, ...]:
    """Return a state of as many numbers as a block has parts; hosts that compile have a form of their own for it.

    A block that ends its step with it declares `STATE_OF_ANY_LENGTH = True`.
    """
    return tuple(values)
