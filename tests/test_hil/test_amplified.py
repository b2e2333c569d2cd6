"""An amplifier behind a source: volts are those at the actuator, all else is the source's own word."""

import pytest
from scripted_source import ClockedSource

from bender_hil.sources.amplified import Amplified
from bender_hil.sources.amplifier import Amplifier
from bender_hil.supply.source import Bounds


class _Kept(ClockedSource):
    bounds: Bounds | None = None

    def arm(self, bounds: Bounds) -> list[str]:
        self.bounds = bounds
        return ["no remark of the amplifier's"]


@pytest.mark.parametrize("amplifier", [Amplifier(20.0), Amplifier(20.0, "inverting"), Amplifier(5.0, offset_V=0.25)])
def test_every_voltage_is_that_at_the_output(amplifier: Amplifier):
    inner = ClockedSource()
    source = Amplified(inner, amplifier)
    for set_it in (source.set_voltage, source.set_voltage_blind):
        set_it(30.0)
        assert inner.level_V == pytest.approx((30.0 - amplifier.offset_V) / amplifier.factor)
        assert source.measured_V() == pytest.approx(30.0)
        assert source.voltage_setting_V() == pytest.approx(30.0)
        set_it(0.0)
    assert source.setting_tolerance_V == pytest.approx(amplifier.gain * 2e-3)
    assert source.rounded(30.0 + 0.3e-3 * amplifier.gain) == pytest.approx(30.0)
    assert source.measured_A() is None
    inner.readings_V = [None]
    assert source.measured_V() is None


def test_everything_else_is_asked_of_the_source():
    inner = ClockedSource(on=True)
    source = Amplified(inner, Amplifier(20.0))
    assert source.open() == inner.open()
    assert source.patience is inner.patience
    assert (source.is_on(), source.confirm_off(), source.has_tripped()) == (True, False, False)
    source.off_blind()
    inner.tripped = True
    assert (source.is_on(), source.confirm_off(), source.has_tripped()) == (False, True, True)
    inner.log.clear()
    for do in (source.reconnect, source.resync, source.release, source.close):
        do()
    assert inner.whats() == ["reconnect", "resync", "release", "close"]


@pytest.mark.parametrize(
    ("amplifier", "low_V", "high_V", "rest_V"),
    [
        (Amplifier(20.0), -1.0, 2.5, 0.0), (Amplifier(20.0, "inverting"), -2.5, 1.0, 0.0),
        (Amplifier(20.0, offset_V=0.5), -1.025, 2.475, -0.025),
    ],
)  # fmt: skip
def test_bounds_and_rest_at_the_input_are_those_of_the_output_without_offset_over_the_gain(
    amplifier: Amplifier, low_V: float, high_V: float, rest_V: float
):
    inner = _Kept()
    remarks = Amplified(inner, amplifier).arm(Bounds(50.0, 55.0, 0.01, -20.0))
    assert inner.bounds is not None
    assert (inner.bounds.minimum_V, inner.bounds.maximum_V) == (pytest.approx(low_V), pytest.approx(high_V))
    assert inner.bounds.current_A == 0.01
    assert inner.bounds.protection_V == pytest.approx(2.75)
    assert inner.level_V == pytest.approx(rest_V)
    assert len(remarks) == 2
    inner.readings_V = [None]
    assert len(Amplified(inner, amplifier).arm(Bounds(50.0, 55.0, 0.01))) == 1


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (Bounds(50.0, 55.0, 0.01), "maximum_V must lie within 0 ... 40 V"),
        (Bounds(40.0, 55.0, 0.01, -20.0), "minimum_V must lie within -10 ... 0 V"),
    ],
)
def test_what_the_amplifier_cannot_give_is_refused(bounds: Bounds, words: str):
    inner = ClockedSource()
    with pytest.raises(ValueError, match=words):
        Amplified(inner, Amplifier(20.0, lowest_V=-10.0, highest_V=40.0)).arm(bounds)
    assert inner.whats() == []


def test_what_the_source_cannot_give_is_told_as_the_input():
    class Refusing(ClockedSource):
        def arm(self, bounds: Bounds) -> list[str]:
            raise ValueError(f"maximum_V must be at most 2, found {bounds.maximum_V}")

    with pytest.raises(ValueError, match=r"at the input of the amplifier, maximum_V must be at most 2, found 2\.5"):
        Amplified(Refusing(), Amplifier(20.0)).arm(Bounds(50.0, 55.0, 0.01))


def test_what_is_played_is_what_gives_these_levels_at_the_output():
    class Playing(ClockedSource):
        has_buffer = True
        played: tuple[list[float], float] = ([], 0.0)

        def play(self, levels_V: list[float], rate_Hz: float) -> float:
            self.played = levels_V, rate_Hz
            return 12.5

    inner = Playing()
    source = Amplified(inner, Amplifier(20.0, "inverting", 0.5))
    assert source.has_buffer
    assert source.play([0.5, 10.5, 30.5], 100.0) == 12.5
    assert inner.played == ([0.0, -0.5, -1.5], 100.0)


def test_a_source_without_a_buffer_plays_nothing_behind_an_amplifier_either():
    source = Amplified(ClockedSource(), Amplifier(20.0))
    assert not source.has_buffer
    with pytest.raises(ValueError, match="no buffer"):
        source.play([1.0], 10.0)
