"""Jobs of one function with many arguments: here one after the other, or on Ray side by side."""

import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, TypeVar

T = TypeVar("T")

RETRIES: Final = 5
"""How often a job whose worker died is begun again."""
LOCAL: Final = "local"


def spread(
    function: Callable[..., T],
    jobs: Mapping[str, tuple[Any, ...]],
    ray: str | None,
    report: Callable[[str, T], Any] = lambda name, result: None,
) -> dict[str, T]:
    """Call a function with the arguments of each job, and return the results by the jobs' names.

    Args:
        function: Function of a module, so that workers can import it; where it is interrupted it may be called again.
        jobs: Arguments by the job's name.
        ray: None for one after the other in this process; `local`, or the address of a Ray cluster.
        report: Called with each result as it comes.
    """
    found = {}
    with contextlib.nullcontext(_here(function, jobs)) if ray is None else _on_ray(function, jobs, ray) as results:
        for name, result in results:
            found[name] = result
            report(name, result)
    return {name: found[name] for name in jobs}


def _here(function: Callable[..., T], jobs: Mapping[str, tuple[Any, ...]]) -> Iterator[tuple[str, T]]:
    for name, arguments in jobs.items():
        yield name, function(*arguments)


@contextlib.contextmanager
def _on_ray(
    function: Callable[..., T], jobs: Mapping[str, tuple[Any, ...]], address: str
) -> Iterator[Iterator[tuple[str, T]]]:
    import ray  # an extra

    with contextlib.redirect_stdout(sys.stderr):  # Ray prints what happens to its workers
        yield from _remotely(ray, function, jobs, address)


def _remotely(
    ray: Any, function: Callable[..., T], jobs: Mapping[str, tuple[Any, ...]], address: str
) -> Iterator[Iterator[tuple[str, T]]]:
    ours = not ray.is_initialized()
    if ours:
        ray.init(
            address=address,
            include_dashboard=False if address == LOCAL else None,
            log_to_driver=False,
            runtime_env={"env_vars": {name: os.environ[name] for name in ("MUJOCO_GL",) if name in os.environ}},
        )
    try:
        remote = ray.remote(function).options(max_retries=RETRIES, num_cpus=1)
        waiting = {remote.remote(*arguments): name for name, arguments in jobs.items()}

        def results() -> Iterator[tuple[str, T]]:
            while waiting:
                (ready, *_), _ = ray.wait(list(waiting), num_returns=1)
                yield waiting.pop(ready), ray.get(ready)

        yield results()
    finally:
        if ours:
            ray.shutdown()
