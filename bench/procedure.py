"""Figures of the operation, part by part.

python bench/procedure.py import          ugly surfaces and label maps: usable, or refused with the reason
python bench/procedure.py closed-forms    blood, cuts, tears, clips and attachments beside their closed forms
python bench/procedure.py clip-and-cut    the routine on 20 patients of all variations
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench.clip_and_cut import clip_and_cut
from bench.closed_forms import closed_forms
from bench.imports import imports

PARTS: Mapping[str, Callable[[], int]] = {
    "clip-and-cut": clip_and_cut,
    "closed-forms": closed_forms,
    "import": imports,
}
"""Parts by name; each returns the number of its figures that fall short."""


def main() -> int:
    """Run the parts asked for; return 1 if a figure falls short."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("parts", nargs="+", choices=PARTS)
    short = 0
    for part in parser.parse_args().parts:
        short += PARTS[part]()
    return int(short > 0)


if __name__ == "__main__":
    sys.exit(main())
