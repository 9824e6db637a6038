"""``python -m ballsim``: the command line."""

from ballsim.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
