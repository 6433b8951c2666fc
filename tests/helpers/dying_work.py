"""Work whose process the system ends. The worker processes of a large run import it by name."""

import os

from adapt.output.large_runs.parts import Work
from motions.table import Motions


class DyingWork(Work):
    """Work that ends its process when a part is asked for."""

    def part(self, motions: Motions) -> bytes:
        os._exit(1)
