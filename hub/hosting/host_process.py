"""A process running a host of a session; the process ends with the hub, its parent.

`python -P -m hub.hosting.host_process --hub PID --connect ENDPOINT --session NAME --host NAME
[--link FD FD [--inbox HOST FD]...]`
"""

from __future__ import annotations

import argparse
import logging
import sys
from contextlib import ExitStack, closing

from hub.hosting.end_with_parent import end_with_parent

__all__ = ["main"]

log = logging.getLogger(__name__)


def main() -> None:
    """Run a host; exit code 1 if a participant of the host failed."""
    parser = argparse.ArgumentParser(
        prog="python -P -m hub.hosting.host_process", description="Host process of Trocar."
    )
    parser.add_argument("--hub", type=int, required=True)
    for option in ("--connect", "--session", "--host"):
        parser.add_argument(option, required=True)
    parser.add_argument("--link", type=int, nargs=2)
    parser.add_argument("--inbox", nargs=2, action="append", default=[])
    arguments = parser.parse_args()
    end_with_parent(arguments.hub)
    # what takes long to import comes after that
    from hub.hosting.joining import run_host
    from hub.transport.host_link import HostLink
    from schemas.errors import TrocarError

    logging.basicConfig(
        level=logging.INFO, format=f"%(levelname)s [{arguments.host}] %(message)s", stream=sys.stderr
    )
    try:
        with ExitStack() as stack:
            link = None
            if arguments.link:
                inboxes = {host: int(end) for host, end in arguments.inbox}
                link = stack.enter_context(closing(HostLink(*arguments.link, inboxes=inboxes)))
            run_host(arguments.connect, arguments.session, arguments.host, link=link)
    except TrocarError as error:
        log.error("%s", error)  # the cause is in the message; the traceback was logged where it happened
        sys.exit(1)


if __name__ == "__main__":
    main()
