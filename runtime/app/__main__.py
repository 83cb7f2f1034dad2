"""``python -m twinscrew.runtime.app``: the command line, for processes that start processes."""

from twinscrew.runtime.app.cli import main

main()
