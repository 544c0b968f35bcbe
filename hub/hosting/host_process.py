"""A process that runs one host of a session, and ends with the hub that has started it.

`python -P -m hub.hosting.host_process --hub PID --connect ENDPOINT --session NAME --host NAME`
"""

from __future__ import annotations

import argparse
import logging
import sys

from hub.hosting.end_with_parent import end_with_parent

__all__ = ["main"]

log = logging.getLogger(__name__)


def main() -> None:
    """Run a host; exit code 1 if one of its participants failed."""
    parser = argparse.ArgumentParser(
        prog="python -P -m hub.hosting.host_process", description="Host process of Trocar."
    )
    parser.add_argument("--hub", type=int, required=True)
    for option in ("--connect", "--session", "--host"):
        parser.add_argument(option, required=True)
    arguments = parser.parse_args()
    end_with_parent(arguments.hub)
    # what takes long to import comes after that
    from hub.hosting.joining import run_host
    from schemas.errors import TrocarError

    logging.basicConfig(
        level=logging.INFO, format=f"%(levelname)s [{arguments.host}] %(message)s", stream=sys.stderr
    )
    try:
        run_host(arguments.connect, arguments.session, arguments.host)
    except TrocarError as error:
        log.error("%s", error)  # the cause is in the message; the traceback was logged where it happened
        sys.exit(1)


if __name__ == "__main__":
    main()
