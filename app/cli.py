"""The entry of the command ``touchline``."""

from __future__ import annotations


def main() -> None:
    """Entry point of ``touchline``."""
    # A process that the program starts reads the program's own file first, and needs nothing of it.
    from app.command_line import run

    run()


if __name__ == "__main__":
    main()
