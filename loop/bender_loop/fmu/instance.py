"""One instance of an FMU: unpacked and loaded once, initialised as often as needed, removed without a trace."""

import contextlib
import ctypes
import shutil
import tempfile
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.archive.bounds import DAMAGE, unpack
from bender_loop.fmu.file import co_simulation, is_fmi3
from bender_loop.fmu.log import Messages, callbacks_for, take_the_log
from bender_loop.fmu.ports import REALS, Setting
from bender_loop.fmu.slave3 import Slave3

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_MESSAGES_SHOWN = 3


class FmuInstance:
    """A co-simulation instance of FMI 2.0 or 3.0 by fmpy's low-level interface.

    Attributes:
        path: the FMU file, for messages.
        component: the instance's handle; it stays the same object when the instance is made anew.
        library: the loaded binary, whose functions may be called directly.

    Raises:
        InputError: the archive is damaged or its binary cannot be loaded.
        RunError: the FMU refuses to be instantiated.
    """

    def __init__(self, path: Path, description: ModelDescription) -> None:
        self.path = path
        self.component = ctypes.c_void_p()
        self._messages = Messages()
        self._callbacks = callbacks_for(self._messages)
        folder = tempfile.mkdtemp(prefix="bender-fmu-")
        self._remove_folder = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        try:
            _unpack(path, folder)
            self._slave = _load(path, description, folder, self._messages)
        except BaseException:
            self._remove_folder()
            raise
        self.library = self._slave.dll
        self._state: Any = None
        self._dead = False
        try:
            self._instantiate()
        except BaseException:
            self.close()
            raise

    @property
    def slave(self) -> Any:
        """Fmpy's own interface to the instance."""
        return self._slave

    @property
    def heard(self) -> int:
        """How many messages the FMU has logged."""
        return self._messages.heard

    def initialise(self, settings: Iterable[Setting], start_s: float = 0.0) -> None:
        """From instantiated or reset to the first communication point, t = `start_s`.

        Raises:
            RunError: the FMU reports an error.
        """
        take_the_log()
        slave = self._slave
        setters = _setters(slave)
        try:
            for kind, reference, value in settings:
                setters[kind]([reference], [value if kind in REALS else int(value)])
            slave.setupExperiment(startTime=start_s)
            slave.enterInitializationMode()
            slave.exitInitializationMode()
        except FMICallException as error:
            raise self.failure("the initialisation", error.status) from error

    def set_inputs(self, settings: Iterable[Setting]) -> None:
        """Set inputs before a step.

        Raises:
            RunError: the FMU reports an error.
        """
        setters = _setters(self._slave)
        try:
            for kind, reference, value in settings:
                setters[kind]([reference], [value])
        except FMICallException as error:
            raise self.failure("setting a further input", error.status) from error

    def reset(self) -> None:
        """Back to instantiated, by the FMU's own reset or, where the FMU fails to or is past it, as a new instance.

        Raises:
            RunError: neither works.
        """
        take_the_log()
        self._messages.clear()
        if not self._dead:
            try:
                self._slave.reset()
            except FMICallException as error:
                self._note(error.status)
            else:
                return
        self._free_instance()
        self._instantiate()

    def save(self) -> bool:
        """Save the state for `restore`; returns whether the FMU could."""
        self._free_state()
        try:
            self._state = self._slave.getFMUstate()
        except FMICallException as error:
            self._note(error.status)
        return self._state is not None

    def restore(self) -> bool:
        """Back to the saved state; returns whether the FMU could."""
        if self._dead or self._state is None:
            return False
        take_the_log()
        self._messages.clear()
        try:
            self._slave.setFMUstate(self._state)
        except FMICallException as error:
            self._note(error.status)
            return False
        return True

    def state(self) -> "SavedState":
        """Return the state as it is now, to come back to with `go_back`.

        Raises:
            RunError: the FMU cannot save its state.
        """
        try:
            return SavedState(self._slave, self._slave.getFMUstate())
        except FMICallException as error:
            raise self.failure("saving the state", error.status) from error

    def go_back(self, saved: "SavedState") -> None:
        """Return to a state.

        Raises:
            RunError: the FMU cannot.
        """
        try:
            self._slave.setFMUstate(saved.state)
        except FMICallException as error:
            raise self.failure("restoring a state", error.status) from error

    def failure(self, action: str, status: int) -> RunError:
        """The error for an FMI status, with what the FMU logged."""
        self._note(status)
        name = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        grave = [text for level, text in self._messages if level > fmi2.fmi2Warning]
        texts = (grave or [text for _, text in self._messages])[-_MESSAGES_SHOWN:]
        said = "; ".join(dict.fromkeys(texts)) or "the FMU logged nothing"
        prefix = "fmi3" if isinstance(self._slave, Slave3) else "fmi2"
        return RunError(f"{self.path}: {action} ended with {prefix}{name}: {said}")

    def close(self) -> None:
        """Free the instance, unload the binary, remove the unpacked files; a second call does nothing."""
        if not self._remove_folder.alive:
            return
        unload = not self._dead
        self._free_instance()
        if unload:
            self._slave.freeLibrary()
        self._remove_folder()

    def _note(self, status: int) -> None:
        # FMI 2.0 allows no call after fmi2Fatal, and PythonFMU has then let go of memory that it would free again.
        self._dead = self._dead or status == fmi2.fmi2Fatal

    def _instantiate(self) -> None:
        take_the_log()
        try:
            self._slave.instantiate(visible=False, callbacks=self._callbacks, loggingOn=True)
        except Exception as error:  # fmpy raises the bare class here
            self._slave.component = None
            texts = "; ".join(text for _, text in self._messages) or " ".join(str(error).split())
            raise RunError(f"{self.path}: the FMU cannot be instantiated: {texts}") from error
        self.component.value = self._slave.component

    def _free_instance(self) -> None:
        """Free the instance, or leave it alone for good when it is dead."""
        if self._slave.component is None:
            return
        if not self._dead:
            self._free_state()
            _free(self._slave)
        self._state = None
        self._dead = False
        self._slave.component = None
        self.component.value = None

    def _free_state(self) -> None:
        if self._state is not None:
            self._slave.freeFMUstate(self._state)
            self._state = None


class SavedState:
    """A state of an instance, freed with this object as long as the instance is there."""

    __slots__ = ("_slave", "state")

    def __init__(self, slave: Any, state: Any) -> None:
        self._slave, self.state = slave, state

    def __del__(self) -> None:
        if self._slave.component is not None:
            self._slave.freeFMUstate(self.state)


def _unpack(path: Path, folder: str) -> None:
    try:
        unpack(path, Path(folder))
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(f"{path}: damaged archive ({error}); get or build the FMU anew") from error


def _setters(slave: Any) -> dict[str, Any]:
    if isinstance(slave, Slave3):
        return slave.setters
    return {"Real": slave.setReal, "Integer": slave.setInteger, "Boolean": slave.setBoolean}


def _free(slave: Any) -> None:
    if isinstance(slave, Slave3):
        slave.free()
    else:
        slave.fmi2FreeInstance(slave.component)


def _load(path: Path, description: ModelDescription, folder: str, messages: Messages) -> Any:
    facts = {
        "guid": description.guid,
        "unzipDirectory": folder,
        "modelIdentifier": co_simulation(description).modelIdentifier,
        "instanceName": description.modelName or "plant",
    }
    try:
        with contextlib.chdir("."):  # fmpy changes the directory for loading and stays there when that fails
            return Slave3(messages, **facts) if is_fmi3(description) else fmi2.FMU2Slave(**facts)
    except Exception as error:  # fmpy raises the bare class and AttributeError for a missing function
        raise InputError(f"{path}: its binary cannot be loaded ({' '.join(str(error).split())})") from error
