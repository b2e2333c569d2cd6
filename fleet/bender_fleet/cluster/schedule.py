"""Units handed out to a cluster and answers taken as they come; retries are Dask's own."""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from bender_fleet.cluster.connect import DEATHS
from bender_fleet.work.job import Job, JobAnswer, run_job
from bender_loop.errors import RunError

if TYPE_CHECKING:
    from distributed import Client

IN_FLIGHT, IN_FLIGHT_WITH_CONTENT = 400, 40
"""Units that the scheduler knows of at a time: what keeps the client's memory flat, and all workers busy."""


class Answer(NamedTuple):
    """What came of a job: what the worker told, or None and why its workers died."""

    job: Job
    told: JobAnswer | None
    reason: str


def answers(client: "Client", jobs: Iterator[Job], *, do: Callable[[Job], JobAnswer] = run_job) -> Iterator[Answer]:
    """Give the answers to all jobs in the order in which they come.

    When the iteration ends early, what is still waiting is cancelled.

    Args:
        client: of the cluster.
        jobs: taken one after the other as there is room.
        do: what a worker does with a job.

    Raises:
        RunError: the workers cannot do the work at all, for want of our package.
    """
    from distributed import as_completed

    waiting: dict[str, tuple[Job, Any]] = {}
    most = IN_FLIGHT_WITH_CONTENT

    def submit(job: Job) -> Any:
        # not pure: the key of a run never meets that of another
        name = f"{job.folder}-{job.key}-{job.run}"
        future = client.submit(do, job, key=name, pure=False)
        waiting[name] = (job, future)
        return future

    try:
        first = [submit(x) for x in islice(jobs, most)]
        if first and all(job.contents is None for job, _ in waiting.values()):
            most = IN_FLIGHT
        ended = as_completed(first, loop=client.loop, with_results=True, raise_errors=False)
        for batch in ended.batches():
            for future, result in batch:
                job, _ = waiting.pop(future.key)
                yield _answer(job, future, result)
            for job in islice(jobs, max(0, most - len(waiting))):
                ended.add(submit(job))
    finally:
        if waiting:
            client.cancel([future for _, future in waiting.values()], force=True)


def _answer(job: Job, future: Any, result: Any) -> Answer:
    from distributed import KilledWorker

    if isinstance(result, JobAnswer):
        return Answer(job, result, "")
    error = result[1] if isinstance(result, tuple) and len(result) == 3 else result
    if isinstance(error, KilledWorker):
        return Answer(
            job, None, f"ended its worker {DEATHS} times, by a crash or for want of memory; see --memory, or look at "
            "its record alone with bender diagnose",
        )  # fmt: skip
    raise RunError(
        f"unit {job.unit}: the workers cannot run it ({type(error).__name__}: {str(error)[:200]}); install the same "
        f"piezo-bender, with its extra `cluster`, on every machine of the cluster ({future.status})"
    )
