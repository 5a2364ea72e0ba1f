"""`python -m armwright`, and the command `armwright`."""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # while modules load, Ctrl-C ends the process without a traceback

from armwright.cli.app import main

if __name__ == "__main__":
    main()
