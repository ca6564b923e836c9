#!/usr/bin/env python3
"""Frames as a stranger hears them: reads LCM's UDP packets itself and decodes them with the types that
`lcm-gen -p` makes of protocol/lcm/, so that it shares no code with the daemon or the tools.

    lcm_subscriber.py --duration 5            one JSON object at the end: what came in on every channel
    lcm_subscriber.py --duration 5 --frames   one JSON line a frame; a channel not measured is null

Says "listening" on standard error once it has joined the group. Exit status 1 where no frame came."""
import argparse
import collections
import json
import os
import pathlib
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(os.environ.get("STICKSLIP_SOURCE_DIR", pathlib.Path(__file__).parents[2]))
FRAMES = "STICKSLIP_FRAMES"
COLUMNS = ("displacement_m", "velocity_m_s", "friction_force_n", "normal_load_n",
           "base_displacement_m", "drive_force_n")
SHORT, FRAGMENT = 0x4C433032, 0x4C433033  # "LC02", "LC03"


def generated_types():
    """The package `stickslip` as lcm-gen makes it."""
    with tempfile.TemporaryDirectory(prefix="stickslip-types-") as folder:
        files = sorted((SOURCE / "protocol/lcm").glob("*.lcm"))
        subprocess.run([os.environ.get("LCM_GEN") or "lcm-gen", "-p", "--ppath", folder,
                        *map(str, files)], check=True, stdout=subprocess.DEVNULL)
        sys.path.insert(0, folder)
        import stickslip
        sys.path.remove(folder)
        return stickslip


def joined(group, port):
    """A socket that hears the group."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if hasattr(socket, "SO_REUSEPORT"):
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
    udp.bind((group, port))
    udp.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                   socket.inet_aton(group) + socket.inet_aton("0.0.0.0"))
    return udp


class Assembler:
    """Packets to messages, by LCM's UDP protocol: a message is one packet, or fragments of which the
    first begins with the channel's name."""

    def __init__(self):
        self.parts = {}  # (sender, number) -> [size, missing fragments, channel, data]
        self.malformed = 0

    def message(self, packet, sender):
        """(channel, payload) where the packet completes a message, else None."""
        try:
            magic, number = struct.unpack_from(">II", packet)
            if magic == SHORT:
                end = packet.index(0, 8)
                return packet[8:end].decode(), packet[end + 1:]
            if magic == FRAGMENT:
                return self.fragment(packet, sender, number)
        except (struct.error, ValueError):
            pass
        self.malformed += 1
        return None

    def fragment(self, packet, sender, number):
        size, offset, index, count = struct.unpack_from(">IIHH", packet, 8)
        data, channel = packet[20:], None
        if index == 0:
            end = data.index(0)
            channel, data = data[:end].decode(), data[end + 1:]
        if size > 1 << 28 or offset + len(data) > size or index >= count:
            raise ValueError("fragment beyond its message")
        key = (sender, number)
        if key not in self.parts:
            for old in [k for k in self.parts if k[0] == sender]:
                del self.parts[old]  # a sender sends one message at a time: the old one lost a part
            self.parts[key] = [size, set(range(count)), None, bytearray(size)]
        part = self.parts[key]
        if part[0] != size:
            raise ValueError("fragments disagree on the size of their message")
        part[1].discard(index)
        part[2] = channel or part[2]
        part[3][offset:offset + len(data)] = data
        if part[1]:
            return None
        del self.parts[key]
        return part[2], bytes(part[3])


def frames_of(block):
    for i in range(block.count):
        frame = {"sequence": block.sequence[i], "time_ns": block.time_ns[i],
                 "degraded": bool(block.flags & 1)}
        for bit, column in enumerate(COLUMNS):
            measured = block.valid[i] >> bit & 1
            frame[column] = getattr(block, column)[i] if measured else None
        yield frame


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, required=True, help="seconds to listen")
    parser.add_argument("--frames", action="store_true", help="print every frame")
    parser.add_argument("--group", default="239.255.76.67:7667", help="multicast group and port")
    options = parser.parse_args()
    group, port = options.group.split(":")

    types = generated_types()
    udp = joined(group, int(port))
    print("listening", file=sys.stderr, flush=True)
    packets = []  # taken first and decoded afterwards, so that a burst finds us reading
    end = time.monotonic() + options.duration
    while (left := end - time.monotonic()) > 0:
        if select.select([udp], [], [], left)[0]:
            packets.append(udp.recvfrom(65536))
    udp.close()

    assembler = Assembler()
    messages = collections.Counter()
    undecoded = collections.Counter()
    count = gaps = lost = 0
    last = first = None
    for packet, sender in packets:
        message = assembler.message(packet, sender)
        if message is None:
            continue
        channel, payload = message
        messages[channel] += 1
        if channel != FRAMES:
            continue
        try:
            block = types.frame_block_t.decode(payload)
        except (ValueError, struct.error):
            undecoded[channel] += 1
            continue
        for frame in frames_of(block):
            if last is not None and frame["sequence"] > last["sequence"] + 1:
                gaps += 1
                lost += frame["sequence"] - last["sequence"] - 1
            count += 1
            first = first or frame
            last = frame
            if options.frames:
                print(json.dumps(frame, allow_nan=False))
    if not options.frames:
        print(json.dumps({
            "messages": messages, "undecoded": undecoded, "malformed_packets": assembler.malformed,
            "unfinished_messages": len(assembler.parts), "frames": count, "gaps": gaps, "lost": lost,
            "first": first, "last": last}, allow_nan=False))
    return 0 if count else 1


if __name__ == "__main__":
    sys.exit(main())
