"""What holds for every test."""

import os
import signal

import hypothesis

# What a shell starts in the background ignores Ctrl-C, and so do all its children;
# with a handler of our own, the programs that tests start and interrupt begin as in a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Property tests play as many examples as fit a minute's test run; the nightly tier plays 100 000 of
# each that does not set its own number: HYPOTHESIS_PROFILE=nightly python -m pytest tests/property
hypothesis.settings.register_profile("nightly", max_examples=100_000, deadline=None)
if "HYPOTHESIS_PROFILE" in os.environ:
    hypothesis.settings.load_profile(os.environ["HYPOTHESIS_PROFILE"])
