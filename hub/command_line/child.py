"""The command line in a process ending with its parent, however the parent ends.

`python -P -m hub.command_line.child PID COMMAND...`; except on Linux, standard input must be a pipe.
"""

from __future__ import annotations

import sys

from hub.hosting.end_with_parent import end_with_parent

__all__: list[str] = []

if __name__ == "__main__":
    end_with_parent(int(sys.argv.pop(1)))
    # what takes long to import comes after that
    from hub.command_line import main

    main()
