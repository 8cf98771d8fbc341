"""What all tests share: started programs react to Ctrl-C, and drawn cases are as many as a quick run can take."""

from __future__ import annotations

import signal

from hypothesis import settings

# A shell without job control starts what runs in the background with SIGINT ignored, and programs inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples on every run and no deadline, as Hypothesis has it, but fewer than its 100 a test.
settings.register_profile("ci", settings.get_profile("ci"), max_examples=40)
