"""Work whose process the system ends. The worker processes of a large run import it by name."""

import os

from adapt.output.large_runs.chunked_run import Work
from motions.table import Motions


class DyingWork(Work):
    """Work that ends its process when a chunk file is asked for."""

    def chunk_file(self, motions: Motions) -> bytes:
        os._exit(1)
