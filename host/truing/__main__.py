"""`python -m truing` is the `truing` command."""

from truing.cli import main

if __name__ == "__main__":
    main()
