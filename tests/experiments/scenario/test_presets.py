"""Links of well-known hardware."""

from __future__ import annotations

import math

import pytest

from volery.agents.beacon import BeaconParameters
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.load import load_scenario
from volery.experiments.scenario.presets import presets
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings, Queue
from volery.transport.media_settings import Aloha, HalfDuplex, Tdma

from .conftest import Load, Refusal

PRESETS = ("irda-115k", "uart-radio-57k", "wifi-adhoc", "802.15.4", "lora", "acoustic-underwater")


def of_preset(name: str, *overrides: str) -> LinkSettings:
    """The settings of links that are nothing but a preset."""
    links = ["topology={star: 4}", f"links={{preset: {name}}}", "agents.rate=1 mHz", *overrides]
    return next(iter(load_scenario("beacons", links).plan.links.values()))


def test_every_preset_has_a_name_and_a_source_of_every_number() -> None:
    """A folder of files, of which each says what it is about and what it leaves out."""
    assert list(presets()) == sorted(PRESETS)
    for preset in presets().values():
        assert preset.sources.keys() == preset.links.keys()
        assert all((preset.about, preset.missing, *preset.sources.values()))


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_loads_and_can_be_run(name: str) -> None:
    """As the links of a small network, with the beacon's own payload."""
    settings = of_preset(name)
    assert settings != LinkSettings()
    assert settings.mtu >= BeaconParameters().size


def test_airtimes_follow_from_the_preset() -> None:
    """20 B over each: with start and stop bits where it is a serial line, and with the frame around them."""
    milliseconds = {name: of_preset(name).airtime_ns(20) / 1e6 for name in PRESETS}
    assert milliseconds == pytest.approx(
        {
            "irda-115k": 26 * 10 / 115.2,
            "uart-radio-57k": 28 * 10 / 57.6,
            "wifi-adhoc": 108 * 8 / 1000,
            "802.15.4": 37 * 8 / 250,
            "lora": 38 * 8 / 5.46875,
            "acoustic-underwater": 20 * 8 / 13.9,
        }
    )


def test_the_airtime_of_lora_is_that_of_the_data_sheet() -> None:
    """Within half a block of 28 bits, 5 symbols, of the formula for every length, and as often above it as below.

    n = 8 + ⌈(8 PL − 4 SF + 28 + 16) / (4 SF)⌉ · 5 symbols of 2^SF / BW after a preamble of 12.25     Semtech SX1276
    """
    settings, symbol_ms = of_preset("lora"), 128 / 125
    apart = []
    for payload in range(1, 256):
        blocks = math.ceil((8 * payload - 28 + 28 + 16) / 28)
        apart.append(settings.airtime_ns(payload) / 1e6 - (12.25 + 8 + 5 * blocks) * symbol_ms)
    assert max(map(abs, apart)) <= 5 * symbol_ms / 2 + 0.3
    assert abs(sum(apart) / len(apart)) < 0.5


def test_lora_keeps_its_duty_cycle() -> None:
    """The bucket lets through 1 % of what the air could carry, and holds just the largest frame."""
    settings = of_preset("lora")
    assert settings.bucket is not None
    assert settings.rate is not None
    assert settings.bucket.rate == settings.rate / 100
    assert settings.bucket.burst == settings.mtu + settings.overhead


def test_what_is_written_beside_a_preset_counts() -> None:
    """Whole fields, and single ones of a medium, a queue and a bucket."""
    plain = of_preset("irda-115k")
    assert plain.medium == HalfDuplex("edge", Aloha())
    changed = of_preset("irda-115k", "links.rate=9.6 kbit/s", "links.latency=1 ms", "links.medium.access={tdma: 5 Hz}")
    assert (changed.rate, changed.latency, changed.mtu) == (9600.0, Constant(1_000_000), plain.mtu)
    assert changed.medium == HalfDuplex("edge", Tdma(5.0))
    lora = of_preset("lora", "links.bucket.burst=1 kB", "links.queue.limit=3")
    assert lora.bucket is not None
    assert (lora.bucket.rate, lora.bucket.burst, lora.queue) == (54.6875, 1000, Queue(3))
    assert of_preset("lora", "links.bucket=null").bucket is None
    assert of_preset("lora", "links.medium=full-duplex").medium != of_preset("lora").medium


def test_some_links_may_be_of_another_preset(load: Load) -> None:
    """What the preset does not say stays as it is for all."""
    plan = compile_plan(load("links.only=[{where: 1-2, preset: uart-radio-57k, mtu: 100 B}]"))
    odd, plain = plan.links["1", "2"], plan.links["2", "3"]
    assert (odd.rate, odd.mtu, odd.loss) == (57_600.0, 100, plain.loss)
    assert plain.rate == 115_200.0


def test_an_unknown_preset_is_named(refusal: Refusal) -> None:
    """With those that there are."""
    said = refusal("links={preset: irda}")
    assert "links.preset" in said
    assert "'irda-115k'" in said
