import os
import subprocess
import sys

import pytest

CODE = """
import os
from bender_hil.realtime import priority
from bender_loop.errors import InputError
try:
    with priority(True):
        assert os.sched_getscheduler(0) == os.SCHED_FIFO
        print("granted")
except InputError as error:
    print(error)
assert os.sched_getscheduler(0) == os.SCHED_OTHER
with priority(False):
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
"""


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="Linux only")
def test_priority_is_taken_and_given_back_or_refused_in_words():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "granted" or "not permitted" in done.stdout
