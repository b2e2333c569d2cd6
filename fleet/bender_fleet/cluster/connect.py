"""A cluster on this machine, or a connection to one that runs."""

import contextlib
import importlib.util
import logging
from collections.abc import Iterator
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bender_fleet.cluster.settings import ClusterSettings
from bender_loop.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

LOOPBACK = "127.0.0.1"
WAIT_S = 10.0
"""Longest wait for the answer of a scheduler."""
DEATHS = 3
"""A unit that has ended so many workers is not given to another one."""
_ONE_THREAD = {f"{x}_NUM_THREADS": "1" for x in ("OMP", "MKL", "OPENBLAS", "NUMBA", "VECLIB_MAXIMUM", "NUMEXPR")}
_LOCAL: dict[str, Any] = {
    # the scheduler gives a task up when it has ended more workers than this
    "distributed.scheduler.allowed-failures": DEATHS - 1,
    # one unit in hand per worker: of two, the innocent one would be blamed for a death too
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
    "distributed.worker.preload": ["bender_fleet.cluster.preload"],
    "distributed.worker.profile.enabled": False,
    # a diagnosis holds the interpreter for seconds, which is no fault
    "distributed.admin.tick.limit": "1h",
    "distributed.comm.timeouts.connect": "30s",
}


@contextlib.contextmanager
def connected(settings: ClusterSettings) -> Iterator["Client"]:
    """Give a client of the cluster; one that was started here ends with it.

    Raises:
        InputError: no scheduler answers at the place that was named.
    """
    from dask import config
    from distributed import Client

    for name in ("distributed", "distributed.worker", "distributed.nanny", "distributed.scheduler", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if settings.is_remote:
        client = _to_running(settings)
        try:
            yield client
        finally:
            client.close(timeout=5)
        return
    # workers leave their folders and locks behind
    with (
        TemporaryDirectory(prefix="bender-fleet-", ignore_cleanup_errors=True) as scratch,
        config.set(_LOCAL | {"temporary-directory": scratch}),
        _local(settings) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _local(settings: ClusterSettings) -> Any:
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=settings.processes,
        threads_per_worker=1,
        processes=True,
        host=LOOPBACK,
        dashboard_address=f"{LOOPBACK}:0" if _has_dashboard() else None,  # pyright: ignore[reportArgumentType]
        memory_limit="auto" if settings.memory_GB is None else f"{settings.memory_GB}GB",
        silence_logs=logging.CRITICAL,
    )


def _to_running(settings: ClusterSettings) -> "Client":
    from distributed import Client
    from distributed.security import Security

    security = None
    if settings.tls_ca is not None:
        security = Security(
            tls_ca_file=str(settings.tls_ca),
            tls_client_cert=str(settings.tls_cert),
            tls_client_key=str(settings.tls_key),
            require_encryption=True,
        )
    file = None if settings.scheduler_file is None else str(settings.scheduler_file)
    where = settings.scheduler or file
    try:
        return Client(
            settings.scheduler,
            scheduler_file=file,
            security=security,
            timeout=WAIT_S,
            set_as_default=False,
        )
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(
            f"{where}: no scheduler answers there within {WAIT_S:g} s ({reason}); is it running, and is the "
            "address the one that it printed?"
        ) from None


def dashboard(client: "Client", settings: ClusterSettings) -> str | None:
    """Return the address of the Dask dashboard, None where there is none; one started here needs bokeh."""
    return client.dashboard_link or None if settings.is_remote or _has_dashboard() else None


def _has_dashboard() -> bool:
    return importlib.util.find_spec("bokeh") is not None
