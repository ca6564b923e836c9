"""Frames out of an LCM event log, read by code that shares nothing with ours: the log's framing is
read here, the types are what `lcm-gen -p` makes of protocol/lcm/."""
import dataclasses
import os
import pathlib
import struct
import subprocess
import sys

from programs import SOURCE

SYNC = 0xEDA1DA01
CHANNELS = ("displacement_m", "velocity_m_s", "friction_force_n", "normal_load_n",
            "base_displacement_m", "drive_force_n")


@dataclasses.dataclass(frozen=True)
class Frame:
    time_ns: int
    sequence: int
    valid: int
    values: bytes  # the six channels' bits, so that equal means equal to the bit


def generate_types(folder):
    """Makes the Python types in `folder` and returns the package."""
    types = sorted((SOURCE / "protocol/lcm").glob("*.lcm"))
    subprocess.run([os.environ.get("LCM_GEN") or "lcm-gen", "-p", "--ppath", str(folder),
                    *map(str, types)], check=True, capture_output=True)
    sys.path.insert(0, str(folder))
    import stickslip
    return stickslip


def events(log):
    """(channel, payload) of every event of a log, in order."""
    data = pathlib.Path(log).read_bytes()
    at = 0
    while at < len(data):
        sync, _number, _time_us, channel_size, size = struct.unpack_from(">IqqII", data, at)
        if sync != SYNC:
            raise ValueError(f"{log}: no event at byte {at}")
        at += 28
        channel = data[at:at + channel_size].decode()
        at += channel_size
        yield channel, data[at:at + size]
        at += size


def payloads(log, channel):
    return [payload for name, payload in events(log) if name == channel]


def frames_of_block(block):
    """The frames of a decoded frame_block_t."""
    columns = [getattr(block, name) for name in CHANNELS]
    return [Frame(block.time_ns[i], block.sequence[i], block.valid[i] & 0xFF,
                  struct.pack(">6d", *(column[i] for column in columns)))
            for i in range(block.count)]


def frames(log, types):
    """Every frame of a log."""
    return [frame for payload in payloads(log, "STICKSLIP_FRAMES")
            for frame in frames_of_block(types.frame_block_t.decode(payload))]
