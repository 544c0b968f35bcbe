"""Prints the tests that failed in the last run, a line each; exit code 1 if there are none.

pytest-xdist puts the name of a test's group behind its id, so `--last-failed` does not find it again.
"""

import json
import sys
from pathlib import Path

CACHE = Path(__file__).parents[1] / ".pytest_cache" / "v" / "cache" / "lastfailed"


def main() -> int:
    failed = json.loads(CACHE.read_text(encoding="utf-8")) if CACHE.is_file() else {}
    for test in failed:
        name, _, group = test.rpartition("@")
        sys.stdout.write(f"{test if not name or ']' in group else name}\n")
    return 0 if failed else 1


if __name__ == "__main__":
    sys.exit(main())
