"""A Dask scheduler and its workers on this machine: `python -m armwright.study.workers.local_cluster N_WORKERS FOLDER`.

Prints how to connect, as JSON on one line, and runs until standard input ends. That is when the process that started it
ends, in whatever way, so no worker outlives it. It must lead a process group of its own, which it kills in the end.
"""

import json
import logging
import os
import shutil
import signal
import sys
import threading
from typing import Any

CREDENTIALS = ("tls_ca_file", "tls_client_cert", "tls_client_key")


def main() -> None:
    """Start the cluster and wait."""
    n_workers, folder = int(sys.argv[1]), sys.argv[2]
    threading.Thread(target=_end_with_parent, args=(folder,), daemon=True).start()
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what evaluators print must not fill the pipe
    logging.disable()  # news of connections that end; workers have a setting of their own
    try:
        cluster, credentials = _start(n_workers, folder)
    except RuntimeError:  # a worker ended while it began, which the process that started this one reports
        sys.exit(1)
    with answer:
        print(json.dumps({"address": cluster.scheduler_address, "credentials": credentials}), file=answer)
    threading.Event().wait()


def _end_with_parent(folder: str) -> None:
    sys.stdin.buffer.read()
    shutil.rmtree(folder, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


def _start(n_workers: int, folder: str) -> tuple[Any, dict[str, str]]:
    """Start a scheduler in this process and the workers as its children, one thread each, with files in `folder`."""
    from dask.config import set as configure
    from distributed import LocalCluster, Security

    configure(
        {
            "distributed.scheduler.http.routes": [],  # no dashboard, nor pages of its kind
            "distributed.worker.http.routes": [],
            "distributed.scheduler.worker-ttl": None,  # code in C may hold Python's lock for long
            "distributed.worker.daemon": False,  # evaluators may start processes
        }
    )
    security = Security.temporary()  # other users of this machine cannot connect
    cluster = LocalCluster(
        n_workers=n_workers,
        threads_per_worker=1,
        security=security,
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        memory_limit=None,
        local_directory=folder,
    )
    return cluster, {name: getattr(security, name) for name in CREDENTIALS}


if __name__ == "__main__":
    main()
