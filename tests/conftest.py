"""What all tests share: the programs that they start react to Ctrl-C, whoever has started the tests."""

from __future__ import annotations

import signal

# A shell without job control starts what runs in the background with SIGINT ignored, and programs inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
