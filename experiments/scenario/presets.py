"""Links of well-known hardware: `links: {preset: irda-115k, …}`, each number with its source.

A preset is what a scenario might have written under `links:` itself. The numbers are typical ones of a class of
hardware, not measurements; what no standard or data sheet says is left out, and so stays at its default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rich.table import Table

PRESET = "preset"
PresetName = Literal["irda-115k", "uart-radio-57k", "wifi-adhoc", "802.15.4", "lora", "acoustic-underwater"]
_MERGED = ("medium", "queue", "bucket")
"""Fields of which a scenario may change a part."""


@dataclass(frozen=True)
class Preset:
    """Settings of links as a scenario has them; field → where its number is from; what the preset does not have."""

    links: Mapping[str, Any]
    sources: Mapping[str, str]
    about: str
    missing: str


_DSSS = {"min_be": 5, "max_be": 5, "max_backoffs": 15, "period": "20 us", "cca": "15 us", "turnaround": "5 us"}

PRESETS: Mapping[PresetName, Preset] = {
    "irda-115k": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "edge", "access": "aloha"},
            "rate": "115.2 kbit/s",
            "bits_per_byte": 10,
            "overhead": "6 B",
            "mtu": "64 B",
            "loss": {"bit-error": 1e-8},
        },
        {
            "medium": "IrDA IrPHY: a receiver is blinded by its own transmitter, so links are half-duplex",
            "rate": "IrDA IrPHY, SIR: 9.6 to 115.2 kbit/s; that of the infrared links of Kriegleder 2012",
            "bits_per_byte": "IrDA IrPHY, SIR: one start bit, eight data bits, one stop bit",
            "overhead": "IrLAP, SIR framing: BOF 1 B, address 1 B, control 1 B, frame check 2 B, EOF 1 B",
            "mtu": "IrLAP: 64 B is the data size that every device can take",
            "loss": "IrDA IrPHY: a bit error ratio of at most 10⁻⁸, within the distance and angle of the link",
        },
        "infrared transceiver pairs of neighbouring modules",
        "Escaped bytes, additional BOFs, the turnaround time of the link, and IrLAP's polling.",
    ),
    "uart-radio-57k": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "edge", "access": "aloha"},
            "rate": "57.6 kbit/s",
            "bits_per_byte": 10,
            "overhead": "8 B",
            "mtu": "244 B",
        },
        {
            "medium": "SiK firmware: a pair of radios shares one channel and takes turns",
            "rate": "SiK firmware, SERIAL_SPEED 57: the serial line, which is narrower than the air with AIR_SPEED 64",
            "bits_per_byte": "UART 8N1: one start bit, eight data bits, one stop bit",
            "overhead": "MAVLink 1: 6 B of header and 2 B of checksum around a payload",
            "mtu": "SiK firmware, MAX_PACKET_LENGTH 252 B, less the 8 B of MAVLink",
        },
        "pairs of telemetry radios with SiK firmware",
        "The second serial line, the radios' turns of up to 131 ms (MAX_WINDOW), and frequency hopping.",
    ),
    "wifi-adhoc": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "node", "access": {"csma": _DSSS}},
            "rate": "1 Mbit/s",
            "overhead": "88 B",
            "mtu": "1472 B",
        },
        {
            "medium": (
                "IEEE 802.11b: slots of 20 µs, aCCATime 15 µs, aRxTxTurnaroundTime 5 µs, backoff of 0 to aCWmin = 31 "
                "slots, which a broadcast does not double; max_backoffs is the most there is, as DCF does not give up"
            ),
            "rate": "IEEE 802.11b: broadcasts go at a basic rate, of which 1 Mbit/s is the lowest",
            "overhead": (
                "IEEE 802.11b: long preamble and PLCP header 192 µs, as long as 24 B at 1 Mbit/s; MAC header 24 B and "
                "check sequence 4 B; LLC and SNAP 8 B; IPv4 20 B; UDP 8 B"
            ),
            "mtu": "1500 B of IP less 28 B of IPv4 and UDP headers",
        },
        "broadcasts of a wireless network without access points",
        "The DCF itself: access is CSMA/CA of the form of IEEE 802.15.4 with these times, so a station that finds the "
        "channel busy draws anew instead of freezing its backoff, and there is no DIFS; higher rates, beacons.",
    ),
    "802.15.4": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "node", "access": "csma"},
            "rate": "250 kbit/s",
            "overhead": "17 B",
            "mtu": "116 B",
        },
        {
            "medium": "IEEE 802.15.4: unslotted CSMA/CA of a network without beacons, standard parameters",
            "rate": "IEEE 802.15.4, O-QPSK at 2.4 GHz: 250 kbit/s",
            "overhead": (
                "IEEE 802.15.4: preamble 4 B, delimiter 1 B, length 1 B; frame control 2 B, sequence 1 B, PAN 2 B, "
                "two short addresses 4 B, check sequence 2 B"
            ),
            "mtu": "IEEE 802.15.4: aMaxPHYPacketSize 127 B, less 11 B of the MAC frame around a payload",
        },
        "low-power radios at 2.4 GHz",
        "Acknowledgements and retries, beacons, security headers.",
    ),
    "lora": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "node", "access": "aloha"},
            "rate": "5468.75 bit/s",
            "overhead": "18 B",
            "mtu": "255 B",
            "bucket": {"rate": "54.6875 bit/s", "burst": "273 B"},
        },
        {
            "medium": "Semtech SX1276: one half-duplex transceiver; LoRaWAN class A nodes send by ALOHA",
            "rate": "Semtech SX1276: SF · BW / 2^SF · 4/5 with spreading factor 7, 125 kHz and code rate 4/5",
            "overhead": (
                "Semtech SX1276, time on air: preamble of 8 + 4.25 symbols, explicit header and CRC take 16.2 B, and "
                "rounding up to blocks of 28 bits 1.75 B on average"
            ),
            "mtu": "Semtech SX1276: the length of a payload is one byte",
            "bucket": "ETSI EN 300 220: duty cycle of 1 % (868.0 to 868.6 MHz); after each frame as LoRaWAN 1.0 asks",
        },
        "long-range radios at 868 MHz with spreading factor 7",
        "Capture of the stronger frame, orthogonal spreading factors, several channels.",
    ),
    "acoustic-underwater": Preset(
        {
            "medium": {"kind": "half-duplex", "per": "node", "access": "aloha"},
            "rate": "13.9 kbit/s",
            "latency": {"constant": "667 ms"},
        },
        {
            "medium": "One transducer sends and receives, and all modems within reach hear it",
            "rate": "EvoLogics S2C R 18/34: up to 13.9 kbit/s",
            "latency": "1 km at 1500 m/s, a round number for the speed of sound in sea water: write your own distance",
        },
        "acoustic modems a kilometre apart",
        "Overhead and largest frame, which differ between modems; multipath; distances that differ between links. "
        "Whether frames collide is decided by when they are sent, not by when their sound arrives.",
    ),
}


def with_preset(written: Any) -> Any:
    """A scenario's `links:` with the preset that it names filled in; what is written beside it counts.

    Of a medium, a queue and a bucket single fields may be written. An unknown name is left for the validator.
    """
    if not isinstance(written, dict) or written.get(PRESET) not in PRESETS:
        return written
    filled = {**PRESETS[written[PRESET]].links, **written}
    for name in _MERGED:
        own, given = PRESETS[written[PRESET]].links.get(name), written.get(name)
        if (
            isinstance(own, Mapping)
            and isinstance(given, dict)
            and given.get("kind", own.get("kind")) == own.get("kind")
        ):
            filled[name] = {**own, **given}
    return filled


def preset_table(name: str, preset: Preset) -> Table:
    """A preset as a table: its fields, and where their numbers are from."""
    from rich.table import Table

    table = Table(
        title=f"{name}: {preset.about}",
        title_justify="left",
        caption=f"Not in it: {preset.missing[0].lower()}{preset.missing[1:]}",
        caption_justify="left",
    )
    for column in ("field", "value", "source"):
        table.add_column(column)
    for field, value in preset.links.items():
        table.add_row(field, _flow(value), preset.sources[field])
    return table


def _flow(value: Any) -> str:
    """A value as YAML has it on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"
    return str(value)
