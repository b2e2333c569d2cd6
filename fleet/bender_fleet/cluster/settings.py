"""Which cluster, checked when it is made; costs nothing to import."""

import importlib.util
import os
from dataclasses import dataclass
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command

NEEDED = ("dask", "distributed", "fsspec", "pyarrow")
LEAST_MEMORY_GB, MOST_WORKERS = 0.25, 4096


@dataclass(frozen=True, slots=True)
class ClusterSettings:
    """A cluster on this machine, or one that runs.

    Attributes:
        workers: processes on this machine; None for one a processor.
        memory_GB: that a worker may take before it is ended; None for its part of this machine's memory.
        scheduler: address of a running scheduler, tcp://… or tls://….
        scheduler_file: that a running scheduler wrote.
        tls_ca: certificate of the authority, for tls://.
        tls_cert: certificate of this client.
        tls_key: its key.

    Raises:
        InputError: a value is out of its range, or two of them contradict each other.
    """

    workers: int | None = None
    memory_GB: float | None = None
    scheduler: str | None = None
    scheduler_file: Path | None = None
    tls_ca: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and not 1 <= self.workers <= MOST_WORKERS:
            raise InputError(f"--workers: found {self.workers}, expected 1 to {MOST_WORKERS}")
        if self.memory_GB is not None and not LEAST_MEMORY_GB <= self.memory_GB <= 1e6:
            raise InputError(f"--memory: found {self.memory_GB:g} GB, expected at least {LEAST_MEMORY_GB:g}")
        if self.scheduler is not None and self.scheduler_file is not None:
            raise InputError("--scheduler and --scheduler-file both name a scheduler; give only one")
        if self.is_remote and (self.workers is not None or self.memory_GB is not None):
            raise InputError(
                "--workers and --memory: found with a scheduler that runs, expected without: its workers have their own"
            )
        if self.scheduler is not None and not self.scheduler.startswith(("tcp://", "tls://")):
            raise InputError(f"--scheduler: found {self.scheduler!r}, expected tcp://HOST:PORT or tls://HOST:PORT")
        self._check_tls()

    def _check_tls(self) -> None:
        files = {"--tls-ca": self.tls_ca, "--tls-cert": self.tls_cert, "--tls-key": self.tls_key}
        given = [name for name, path in files.items() if path is not None]
        if given and len(given) < len(files):
            missing = next(name for name in files if name not in given)
            raise InputError(f"{missing}: is missing beside {given[0]}; expected {', '.join(files)} together")
        for name, path in files.items():
            if path is not None and not path.is_file():
                raise InputError(f"{name}: found no file {path}, expected one in PEM form")
        if given and not self.is_remote:
            raise InputError(f"{given[0]}: found without a scheduler, expected --scheduler or --scheduler-file with it")
        if self.scheduler is not None and self.scheduler.startswith("tls://") and not given:
            raise InputError("--scheduler tls://: expected --tls-ca, --tls-cert and --tls-key with it")
        if self.scheduler_file is not None and not self.scheduler_file.is_file():
            raise InputError(
                f"--scheduler-file: found no file {self.scheduler_file}, expected the one that "
                "`dask scheduler --scheduler-file` writes; is the scheduler running?"
            )

    @property
    def is_remote(self) -> bool:
        """Whether the cluster is one that runs already."""
        return self.scheduler is not None or self.scheduler_file is not None

    @property
    def processes(self) -> int:
        """How many workers are started on this machine."""
        return self.workers if self.workers is not None else own_processors()


def own_processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return max(1, os.cpu_count() or 1)


def require_cluster() -> None:
    """Refuse to go on where the extra is not installed.

    Raises:
        InputError: a package is missing.
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"bender fleet needs {', '.join(missing)}, not found here; {install_command('cluster')}")
