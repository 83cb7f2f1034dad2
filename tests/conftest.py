"""What holds for every test."""

import signal

# A shell that starts something in the background has it ignore Ctrl-C, and its children inherit that;
# with a handler of our own, the programs that tests start and interrupt begin as in a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
