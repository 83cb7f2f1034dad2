"""``python -m twinscrew.runtime.cli``, and what `twinscrew` starts with."""

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line; Ctrl-C ends it without a traceback, also while it is still loaded."""
    try:
        from twinscrew.runtime.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
