"""Work whose process the system ends, for the processes of a large run: they import it by name."""

import os

from adapt.output.large_runs.parts import Work
from motions.table import Motions


class DyingWork(Work):
    """Ends the process that makes a part."""

    def part(self, motions: Motions) -> bytes:
        os._exit(1)
