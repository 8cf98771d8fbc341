"""The radios of radios.py in ns-3, where its Python package (`pip install ns3`) is installed; what runs is C++."""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path

_ETHERNET_BYTES = 18
"""What an Ethernet frame has besides its payload; the frame is as long as that of radios.py."""


def run(
    nodes: int, seconds: float, frames_per_second: float, frame_bytes: int, bits_per_second: int
) -> dict[str, float]:
    """CPU µs per frame at a receiver; receptions; the share delivered, which is all."""
    ns = import_module("ns").ns
    ns.cppyy.cppdef(Path(__file__).with_name("ns3_radios.cc").read_text(encoding="ascii"))
    bench = ns.cppyy.gbl.volery_bench
    bench.Build(nodes, frames_per_second, frame_bytes - _ETHERNET_BYTES, bits_per_second)
    ns.Simulator.Stop(ns.Seconds(seconds))
    began = time.process_time()
    ns.Simulator.Run()
    spent = time.process_time() - began
    return {"cpu_us": spent / bench.heard * 1e6, "receptions": bench.heard, "delivered": 1.0}
