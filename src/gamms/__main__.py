"""`python -m gamms`: the same as `gamms`."""

from gamms.cli import main

if __name__ == "__main__":
    main()
