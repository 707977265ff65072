"""`python -m pe_runtime.benchmark FOLDER`: one measuring process; `processes.measure` starts it."""

import sys
from pathlib import Path

from pe_runtime.benchmark.processes import carry_out_in

if __name__ == "__main__":
    carry_out_in(Path(sys.argv[1]))
