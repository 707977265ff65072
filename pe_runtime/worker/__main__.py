"""`python -m pe_runtime.worker`: the worker without the command line's own imports."""

import argparse
import sys

from pe_runtime.worker.process import run_worker


def main() -> int:
    """Serve the wire on this process's stdin and stdout; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m pe_runtime.worker", description=__doc__)
    parser.add_argument("--fake", action="store_true", help="a moving gradient, no torch needed")
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda, ...")
    arguments = parser.parse_args()
    return run_worker(fake=arguments.fake, device=arguments.device)


if __name__ == "__main__":
    sys.exit(main())
