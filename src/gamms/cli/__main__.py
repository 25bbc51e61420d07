"""`python -m gamms.cli`: the same as `gamms`."""

from gamms.cli import main

if __name__ == "__main__":
    main()
