"""What all tests share: Ctrl-C for started programs, few drawn cases in a quick run, output as wide as in a file."""

from __future__ import annotations

import os
import signal

from hypothesis import settings

# A shell without job control starts what runs in the background with SIGINT ignored, and programs inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples on every run and no deadline, as Hypothesis has it, but fewer than its 100 a test.
settings.register_profile("ci", settings.get_profile("ci"), max_examples=40)

# Tables are as wide as in a file, whatever terminal the tests are started from or a notebook's kernel claims to have.
os.environ.pop("COLUMNS", None)
