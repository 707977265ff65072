"""`python -m pe_runtime.cli`: the command `pe` where its script is not on the path."""

from pe_runtime.cli import main

if __name__ == "__main__":
    main()
