"""What holds for every test."""

import signal

# What a shell starts in the background ignores Ctrl-C, and so do all its children;
# with a handler of our own, the programs that tests start and interrupt begin as in a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
