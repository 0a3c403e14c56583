"""Entry point of the `armature` command."""

from __future__ import annotations

import signal


def run() -> None:
    """Run the command line of this process."""
    # Some libraries catch whatever comes while they are imported, Ctrl-C included. Until then it ends the process.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from armature.cli.commands import app

    signal.signal(signal.SIGINT, signal.default_int_handler)
    app(prog_name="armature")


if __name__ == "__main__":
    run()
