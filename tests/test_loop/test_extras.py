import pytest

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command, require


def test_an_extra_is_installed_by_what_an_index_has():
    assert "nicegui" in install_command("live").split()
    assert "piezo-bender" not in install_command("formats")
    assert '".[nonsense]" in the checkout' in install_command("nonsense")


def test_what_is_missing_is_refused_with_the_command_that_brings_it():
    require("json", "live", "this")
    with pytest.raises(InputError, match=r"this needs no_such_module.*python -m pip install .*pyarrow"):
        require("no_such_module", "formats", "this")
