"""The emulator knows nothing of the drivers, and has a counterpart for each of them."""

from bender_emulator.__main__ import INSTRUMENTS
from bender_emulator.sensors.settings import KINDS
from bender_hil.sensors.meter_dialect import METERS
from bender_hil.sensors.scope_dialect import SCOPES
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.supply.select import GENERATOR


def test_every_instrument_that_can_be_driven_is_emulated():
    assert set(KINDS) == {*METERS, *SCOPES, "text", "daq"}
    assert set(INSTRUMENTS) == {GENERATOR, *LINE_DIALECTS, "daq"}
