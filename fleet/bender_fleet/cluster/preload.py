"""What a worker of this machine does first: it leaves Ctrl-C to the client, which ends its workers in good order."""

import signal
import threading


def dask_setup(_: object) -> None:
    """Ignore SIGINT, which a terminal sends to all processes of a command; Dask calls this in every worker."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
