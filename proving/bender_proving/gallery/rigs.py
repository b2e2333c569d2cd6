"""The rigs by name."""

from bender_proving.gallery.damper import DAMPER
from bender_proving.gallery.duffing import DUFFING
from bender_proving.gallery.servo import SERVO
from bender_proving.gallery.tanks import TANKS
from bender_proving.gallery.thermocouple import THERMOCOUPLE
from bender_proving.gallery.valve import VALVE

RIGS = {x.name: x for x in (SERVO, DUFFING, TANKS, THERMOCOUPLE, VALVE, DAMPER)}
