"""What holds for every test."""

import os
import signal

import hypothesis

# What a shell starts in the background ignores Ctrl-C, and so do all its children;
# with a handler of our own, the programs that tests start and interrupt begin as in a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Property tests play as many examples as fit a minute's test run, and the same ones every time: a
# landing does not depend on luck. The nightly tier looks for new ones, 100 000 of each test that
# does not set its own number: HYPOTHESIS_PROFILE=nightly python -m pytest tests/property
hypothesis.settings.register_profile("landing", derandomize=True, deadline=None)
hypothesis.settings.register_profile("nightly", max_examples=100_000, deadline=None)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "landing"))
