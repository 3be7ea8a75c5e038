"""``python -m pneumo_casadi``, and the entry point of ``pneumo-casadi``."""

import os
import signal
import sys

from pneumo_casadi.runtime.interruption import ENDING, interruptible


def main() -> None:
    """Run the command line; an interruption while it is loaded is one line too."""
    with interruptible() as interruption:
        code = 0
        try:
            from pneumo_casadi.cli.app import run

            code = run()
        except BaseException:  # the command line turns KeyboardInterrupt into an error of its own
            if not interruption.number:
                raise
        if interruption.number and not interruption.explained:
            sys.stderr.write(interruption.line)
            code = interruption.exit_code
        if interruption.number:  # at once: the end of the interpreter may take seconds
            sys.stdout.flush()
            os._exit(code)
    for number in ENDING:  # all is written: no traceback while the interpreter ends
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    sys.exit(code)


if __name__ == "__main__":
    main()
