# SPDX-License-Identifier: Apache-2.0
"""The server of the live view: streams equal the traffic on LCM, and clients that violate the protocol
do not affect others."""
import collections
import json
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time
import urllib.request

from frames import CHANNELS, frames_of_block, generate_types, payloads
from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, main, needs_page
from web_socket import (BINARY, PING, TEXT, Closed, Refused, WebSocket, connect, frame, handshake)

RIG = SOURCE / "config/simulated.toml"


def decoded(message):
    """(columns, flags) of a message of frames. Columns: time_ns, sequence, and the bits of each channel."""
    kind, flags, channels, n = struct.unpack_from("<BBHI", message)
    assert kind == 1 and channels == len(CHANNELS), (kind, channels)
    assert len(message) == 16 + 8 * n * (2 + channels)
    column = [struct.unpack_from(f"<{n}Q", message, 16 + 8 * n * i) for i in range(2 + channels)]
    return column, flags


def frames_in(messages, history=None):
    """{sequence: (time, bits of the channels)} of binary messages. `history`: selects past or live ones."""
    out = {}
    for kind, payload in messages:
        if kind != BINARY:
            continue
        column, flags = decoded(payload)
        if history is not None and bool(flags & 2) != history:
            continue
        for row in zip(*column):
            assert row[1] not in out, f"frame {row[1]} was received twice"
            out[row[1]] = row[0:1] + row[2:]
    return out


def texts_in(messages):
    return [json.loads(payload) for kind, payload in messages if kind == TEXT]


def is_nan(bits):
    return bits & 0x7FF0000000000000 == 0x7FF0000000000000 and bits & 0x000FFFFFFFFFFFFF != 0


class Reader(threading.Thread):
    """A well-behaved client that collects all messages until `end`."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.stream = WebSocket(port, timeout=0.5)
        self.messages = []
        self.failure = None
        self.ending = threading.Event()
        self.start()

    def run(self):
        try:
            while not self.ending.is_set():
                try:
                    self.messages.append(self.stream.receive())
                except TimeoutError:
                    pass
        except Exception as error:  # checked by the test in its own thread
            self.failure = error

    def end(self):
        self.ending.set()
        self.join(10)
        self.stream.close()
        return self.messages


@needs_page
class Scope(EndToEnd):
    """A server that is fed from LCM."""
    options = ()

    def setUp(self):
        super().setUp()
        self.server, self.port = self.start_scope(*self.options)

    def start_scope(self, *options):
        log = open(self.folder / "scope.log", "w+")
        self.addCleanup(log.close)
        server = subprocess.Popen([STICKSLIP, "scope", "--listen", "127.0.0.1:0", *options],
                                  stdout=subprocess.PIPE, stderr=log, text=True)
        self.addCleanup(server.stdout.close)
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        line = server.stdout.readline()
        found = re.fullmatch(r"live view: http://127\.0\.0\.1:(\d+)/\S*\n", line)
        self.assertIsNotNone(found, line + (self.folder / "scope.log").read_text())
        return server, int(found[1])

    def start_daemon(self, *options):
        daemon = subprocess.Popen([STICKSLIPD, "--config", str(RIG), *options],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(daemon.wait)
        self.addCleanup(daemon.kill)
        return daemon

    def start_recorder(self, name):
        """A recorder of all traffic on LCM."""
        recorder = subprocess.Popen([STICKSLIP, "record", str(self.folder / name)],
                                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(recorder.wait)
        self.addCleanup(recorder.kill)
        return recorder

    def stop(self, process):
        process.send_signal(signal.SIGTERM)
        return process.wait(30)

    def wait_for_frames(self, client, count=50):
        """Messages until `count` live frames have been received."""
        out = []
        seen = 0
        end = time.monotonic() + PATIENCE_S
        while seen < count:
            self.assertLess(time.monotonic(), end, texts_in(out)[-3:])
            out.append(client.receive())
            seen += len(frames_in(out[-1:], history=False))
        return out

    def assert_still_serves(self):
        """A well-behaved client still receives the page and a stream."""
        self.assertIsNone(self.server.poll(), "the server has ended")
        status, _, body = self.get("/")
        self.assertEqual(status, 200)
        self.assertIn(b"<!doctype html>", body.lower())
        with WebSocket(self.port) as client:
            self.assertEqual(texts_in([client.receive()])[0]["type"], "hello")

    def request(self, request, timeout=PATIENCE_S, whole=True):
        """Sends bytes and returns the answer until the server closes."""
        with connect(self.port, timeout) as peer:
            out = b""
            try:
                peer.sendall(request)
                if whole:
                    peer.shutdown(socket.SHUT_WR)
                while data := peer.recv(1 << 16):
                    out += data
            except TimeoutError:
                raise
            except OSError:
                pass  # closed by the server
            return out

    def get(self, path, method="GET", host=None, headers=()):
        """(status, headers, body); status 0 if the server only closed the connection."""
        lines = [f"{method} {path} HTTP/1.1", f"Host: {host or f'127.0.0.1:{self.port}'}",
                 "Connection: close", *headers]
        answer = self.request(("\r\n".join(lines) + "\r\n\r\n").encode("latin-1"), whole=False)
        head, _, body = answer.partition(b"\r\n\r\n")
        if not head.startswith(b"HTTP/1."):
            return 0, {}, b""
        first, *rest = head.decode("latin-1").split("\r\n")
        return int(first.split()[1]), \
            {k.lower(): v for k, v in (line.split(": ", 1) for line in rest if ": " in line)}, body


class Streams(Scope):
    def recorded_frames(self):
        """Frames of a recording made in parallel from LCM: the reference for the streams."""
        types = generate_types(self.folder)
        out = {}
        for payload in payloads(self.folder / "reference.log", "STICKSLIP_FRAMES"):
            block = types.frame_block_t.decode(payload)
            columns = [getattr(block, name) for name in CHANNELS]
            for i in range(block.count):
                bits = tuple(struct.unpack("<Q", struct.pack("<d", column[i]))[0]
                             if block.valid[i] >> c & 1 else None for c, column in enumerate(columns))
                out[block.sequence[i]] = (block.time_ns[i],) + bits
        return out

    def test_ten_clients_receive_every_frame_unchanged(self):
        recorder = self.start_recorder("reference.log")
        clients = [Reader(self.port) for _ in range(10)]
        time.sleep(1)
        daemon = self.start_daemon("--duration", "5")
        self.assertEqual(daemon.wait(60), 0)
        time.sleep(1)
        self.assertEqual(self.stop(recorder), 0)
        recorded = self.recorded_frames()
        self.assertGreater(len(recorded), 3000)
        for client in clients:
            messages = client.end()
            self.assertIsNone(client.failure)
            got = frames_in(messages)
            self.assertEqual(set(got), set(recorded))
            for sequence, row in recorded.items():
                time_ns, *bits = got[sequence]
                self.assertEqual(time_ns, row[0])
                for ours, theirs in zip(bits, row[1:]):
                    if theirs is None:
                        self.assertTrue(is_nan(ours))
                    else:
                        self.assertEqual(ours, theirs)
            kinds = collections.Counter(text["type"] for text in texts_in(messages))
            self.assertNotIn("dropped", kinds)
            for kind in ("hello", "model", "source", "estimate", "excitation", "status", "timing", "event", "alive"):
                self.assertIn(kind, kinds)

    def test_excitation_has_the_time_of_each_frame(self):
        client = Reader(self.port)
        self.assertEqual(self.start_daemon("--duration", "3").wait(60), 0)
        messages = client.end()
        times = {row[0] for row in frames_in(messages).values()}
        times_sent = [t for text in texts_in(messages) if text["type"] == "excitation" for t in text["time_ns"]]
        self.assertGreater(len(times_sent), 2000)
        self.assertEqual(len(times_sent), len(set(times_sent)))
        self.assertEqual(set(times_sent) - times, set())

    def test_a_new_client_receives_the_history_and_then_live_frames(self):
        self.start_daemon()
        with WebSocket(self.port) as early:
            before = frames_in(self.wait_for_frames(early, 2000))
            with WebSocket(self.port) as late:
                messages = self.wait_for_frames(late, 500)
        self.assertEqual([text["type"] for text in texts_in(messages)][:4], ["hello", "sources", "model", "source"])
        past = frames_in(messages, history=True)
        now = frames_in(messages, history=False)
        self.assertEqual(set(before) - set(past) - set(now), set())
        for sequence in set(before) & set(past):
            self.assertEqual(before[sequence], past[sequence])
        everything = sorted([*past, *now])
        self.assertEqual(everything, list(range(everything[0], everything[0] + len(everything))),
                         "a gap or a repetition between history and stream")

    def test_two_daemons_are_distinguished(self):
        other = self.folder / "other"
        shutil.copytree(SOURCE / "config", other)
        config = other / "simulated.toml"
        config.write_text(config.read_text().replace("simulated rig", "another rig"))
        self.start_daemon()
        with WebSocket(self.port) as client:
            messages = self.wait_for_frames(client, 500)
            daemon = subprocess.Popen([STICKSLIPD, "--config", str(config), "--control", str(other / "control")],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(daemon.wait)
            self.addCleanup(daemon.kill)
            sources = []
            end = time.monotonic() + PATIENCE_S
            while [one["rig"] for one in sources] != ["simulated rig", "another rig"]:
                self.assertLess(time.monotonic(), end, sources)
                messages.append(client.receive())
                for text in texts_in(messages[-1:]):
                    sources = text.get("sources", sources)
            messages += self.wait_for_frames(client, 2000)
        self.assertNotIn("restart", [text["type"] for text in texts_in(messages)][1:])
        self.assertEqual({text["rig"] for text in texts_in(messages) if text["type"] == "model"}, {"simulated rig"})
        self.assert_whole(messages)
        for one in sources:
            with self.subTest(rig=one["rig"]), WebSocket(self.port, path=f"/stream?source={one['id']}") as client:
                messages = self.wait_for_frames(client, 1000)
                rigs = {text["rig"] for text in texts_in(messages) if text["type"] == "model"}
                self.assertEqual(rigs, {one["rig"]})
                self.assert_whole(messages)

    def assert_whole(self, messages):
        """The frames are those of one daemon: in order, at one rate, and (but for what a busy machine loses) all."""
        got = sorted((row[0], sequence) for sequence, row in frames_in(messages).items())
        numbers = [sequence for _, sequence in got]
        self.assertEqual(numbers, sorted(numbers), "times and numbers are of two daemons")
        self.assertGreater(len(numbers), 0.5 * (numbers[-1] - numbers[0]))

    def test_a_server_started_later_receives_the_model(self):
        self.start_daemon()
        with WebSocket(self.port) as early:
            self.wait_for_frames(early, 100)
        _, self.port = self.start_scope()
        with WebSocket(self.port) as client:
            messages = self.wait_for_frames(client, 1)
            end = time.monotonic() + PATIENCE_S
            while not any(text["type"] == "model" for text in texts_in(messages)):
                self.assertLess(time.monotonic(), end, "the daemon did not repeat its description")
                messages.append(client.receive())
        model = next(text for text in texts_in(messages) if text["type"] == "model")
        self.assertEqual(model["rig"], "simulated rig")
        self.assertIn("natural frequency", [mark["name"] for mark in model["marks"]])

    def test_a_restart_of_the_daemon_is_reported(self):
        with WebSocket(self.port) as client:
            first = self.start_daemon()
            self.wait_for_frames(client, 500)
            self.stop(first)
            texts = []
            while not texts or texts[-1] != ("source", False):
                texts += [(t["type"], t.get("connected")) for t in texts_in([client.receive()])]
            self.start_daemon()
            messages = self.wait_for_frames(client, 100)
            kinds = [t["type"] for t in texts_in(messages)]
            self.assertIn("restart", kinds)
            self.assertIn(("source", True), [(t["type"], t.get("connected")) for t in texts_in(messages)])
            at = next(i for i, m in enumerate(messages) if m[0] == TEXT and b'"restart"' in m[1])
            self.assertEqual(frames_in(messages[:at]), {}, "frames of the new run before the restart")
            with WebSocket(self.port) as late:
                past = frames_in(self.wait_for_frames(late, 1), history=True)
            self.assertLess(min(past), 100, "history is that of the new run")

    def test_a_signal_closes_all_streams(self):
        with WebSocket(self.port) as client:
            client.receive()
            self.server.send_signal(signal.SIGINT)
            with self.assertRaises((Closed, ConnectionResetError)):
                while True:
                    client.receive()
        self.assertEqual(self.server.wait(10), 0)


class Page(Scope):
    def test_the_page_has_its_security_headers(self):
        status, headers, body = self.get("/")
        self.assertEqual(status, 200)
        self.assertEqual(int(headers["content-length"]), len(body))
        self.assertTrue(headers["content-type"].startswith("text/html"))
        policy = headers["content-security-policy"]
        for directive in ("default-src 'none'", "script-src 'self'", "connect-src 'self'", "frame-ancestors 'none'"):
            self.assertIn(directive, policy)
        self.assertNotIn("unsafe", policy)
        self.assertEqual(headers["x-content-type-options"], "nosniff")
        self.assertEqual(headers["referrer-policy"], "no-referrer")
        self.assertEqual(headers["cross-origin-resource-policy"], "same-origin")
        self.assertNotIn("access-control-allow-origin", headers)
        # Refusals have them too.
        _, headers, _ = self.get("/nothing")
        self.assertIn("content-security-policy", headers)

    def test_every_file_of_the_page_is_served(self):
        for file in sorted((SOURCE / "tools/scope/page").iterdir()):
            if file.suffix not in (".html", ".css", ".js", ".svg", ".png"):
                continue
            with self.subTest(file=file.name):
                status, headers, body = self.get("/" if file.name == "index.html" else "/" + file.name)
                self.assertEqual((status, body), (200, file.read_bytes()))
                self.assertIn({".html": "html", ".css": "css", ".js": "javascript", ".svg": "svg",
                               ".png": "png"}[file.suffix], headers["content-type"])
        for name in ("/uPlot.esm.js", "/uPlot.min.css", "/uPlot-license.txt"):
            status, _, body = self.get(name)
            self.assertEqual(status, 200)
            self.assertGreater(len(body), 1000)

    def test_cached_files_are_not_sent_again(self):
        status, headers, body = self.get("/uPlot.esm.js")
        again = self.get("/uPlot.esm.js", headers=[f"If-None-Match: {headers['etag']}"])
        self.assertEqual((again[0], again[2]), (304, b""))
        self.assertEqual(self.get("/uPlot.esm.js", method="HEAD")[0], 200)
        self.assertEqual(self.get("/uPlot.esm.js", method="HEAD")[2], b"")


class Hostile(Scope):
    """Each test runs next to a well-behaved client, which must not lose a frame."""

    def setUp(self):
        super().setUp()
        self.start_daemon()
        self.good = Reader(self.port)
        end = time.monotonic() + PATIENCE_S
        while len(self.good.messages) < 50:
            self.assertLess(time.monotonic(), end)
            time.sleep(0.05)

    def tearDown(self):
        time.sleep(0.3)
        messages = self.good.end()
        self.assertIsNone(self.good.failure, "the well-behaved client lost its stream")
        got = sorted(frames_in(messages))
        self.assertEqual(got, list(range(got[0], got[0] + len(got))), "the well-behaved client lost frames")
        self.assertNotIn("dropped", [text["type"] for text in texts_in(messages)])
        self.assert_still_serves()
        super().tearDown()

    def refused(self, expected, **request):
        with self.assertRaises(Refused) as caught:
            WebSocket(self.port, **request)
        self.assertEqual(caught.exception.status, expected, caught.exception)

    def test_foreign_origins_and_host_names_are_refused(self):
        own = f"127.0.0.1:{self.port}"
        WebSocket(self.port, origin=f"http://{own}").close()
        WebSocket(self.port, host="localhost:1", origin="http://localhost:1").close()
        for origin in ("http://evil.example", "null", "http://127.0.0.1", f"http://{own}.evil.example",
                       f"http://{own}@evil.example", f"ftp://{own}"):
            with self.subTest(origin=origin):
                self.refused(403, origin=origin)
        for host in ("evil.example", f"evil.example:{self.port}", "127.0.0.1.evil.example", "10.1.2.3",
                     f"{own}, evil.example", "a b"):
            with self.subTest(host=host):
                self.refused(403, host=host)
                self.assertEqual(self.get("/", host=host)[0], 403)
        nameless = self.request(b"GET / HTTP/1.0\r\n\r\n")
        self.assertNotIn(b"200", nameless.split(b"\r\n")[0])

    def test_the_stream_has_one_path_and_subprotocol(self):
        self.refused(404, path="/")
        self.refused(404, path="/stream/")
        self.refused(404, path="/uPlot.esm.js")
        self.refused(400, subprotocol="chat")
        self.refused(400, subprotocol=None)
        self.assertEqual(self.get("/stream")[0], 404)
        # HTTP/2 without TLS is not supported.
        answer = self.request(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nConnection: Upgrade, "
                          "HTTP2-Settings\r\nUpgrade: h2c\r\nHTTP2-Settings: AAMAAABkAAQAAP__\r\n\r\n".encode(),
                          whole=False)
        self.assertNotIn(b" 101 ", answer.split(b"\r\n")[0])

    def test_only_files_of_the_page_are_served(self):
        secret = b"root:"
        page = self.get("/")[2]
        for path in ("/../../../../etc/passwd", "/..%2f..%2f..%2fetc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
                     "/....//....//etc/passwd", "//etc/passwd", "/etc/passwd", "/scope/../../etc/passwd",
                     "/..\\..\\etc\\passwd", "/%00", "/uPlot.esm.js%00.html", "/uPlot.esm.js/",
                     "/page/index.html", "/.git/config", "/index.html/../../etc/passwd", "/%c0%ae%c0%ae/",
                     "file:///etc/passwd", "http://127.0.0.1/etc/passwd", "/%", "/%zz", "*", "/?/../etc/passwd",
                     "/" + "../" * 200 + "etc/passwd", "/" + "a" * 3000):
            with self.subTest(path=path[:60]):
                status, _, body = self.get(path)
                self.assertNotIn(secret, body)
                if status == 200:  # the part before a question mark or a zero may name the page
                    self.assertEqual(body, page)
                else:
                    self.assertIn(status, (0, 400, 403, 404, 414, 431))

    def test_other_methods_are_refused(self):
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "PROPFIND",
                       "GETS", "X" * 200, "\x00", "PRI"):
            with self.subTest(method=method[:20]):
                self.assertIn(self.get("/", method=method)[0], (0, 400, 403, 404, 405, 501))
        body = b"x" * 100000
        answer = self.request(f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nContent-Length: {len(body)}\r\n\r\n"
                          .encode() + body)
        self.assertNotIn(b" 200 ", answer.split(b"\r\n")[0])

    def test_headers_are_limited(self):
        own = f"Host: 127.0.0.1:{self.port}\r\n".encode()
        for name, request in {
                "one long header": b"GET / HTTP/1.1\r\n" + own + b"X: " + b"a" * 2000000 + b"\r\n\r\n",
                "a long cookie": b"GET / HTTP/1.1\r\n" + own + b"Cookie: " + b"a" * 100000 + b"\r\n\r\n",
                "many headers": b"GET / HTTP/1.1\r\n" + own + b"".join(b"X%d: y\r\n" % i for i in range(50000)),
                "a long path": b"GET /" + b"a" * 200000 + b" HTTP/1.1\r\n" + own + b"\r\n",
                "a long query": b"GET /?token=" + b"a" * 200000 + b" HTTP/1.1\r\n" + own + b"\r\n",
                "rubbish": bytes(range(256)) * 400,
                "TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + os.urandom(500),
                "HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\x00" * 100}.items():
            with self.subTest(what=name):
                self.assertNotIn(b" 101 ", self.request(request)[:40])

    def test_a_client_that_sends_is_disconnected(self):
        for name, data in {"text": frame(TEXT, b"hello"), "binary": frame(BINARY, b"x" * 200),
                           "empty": frame(TEXT, b""), "a part": frame(TEXT, b"x", final=False),
                           "much": frame(BINARY, b"x" * 500000),
                           "claims 4 EB": frame(BINARY, b"x" * 1000, claimed=1 << 62),
                           "claims more than there is": frame(BINARY, b"x", claimed=1 << 63),
                           "unmasked": frame(TEXT, b"hello", masked=False),
                           "a reserved opcode": frame(0xB, b"x"),
                           "reserved bits": bytes([0xF1, 0x80, 0, 0, 0, 0]),
                           "a long ping": bytes([0x89, 0xFE, 0x40, 0x00]) + b"\0" * 20000,
                           "rubbish": os.urandom(4000)}.items():
            with self.subTest(sent=name), WebSocket(self.port) as client:
                self.wait_for_frames(client, 1)
                with self.assertRaises((Closed, ConnectionResetError, BrokenPipeError)) as caught:
                    client.send(data)
                    end = time.monotonic() + PATIENCE_S
                    while time.monotonic() < end:
                        client.receive()
                if name == "text":  # with a reason, unless a message was being written
                    self.assertIn(getattr(caught.exception, "code", None), (1008, None))

    def test_a_flood_of_pings_is_harmless(self):
        with WebSocket(self.port) as client:
            client.receive()
            try:
                for _ in range(3000):
                    client.send(frame(PING, b"x" * 100))
                client.receive()
            except (Closed, OSError):
                pass  # it may be disconnected

    def test_losses_of_a_slow_reader_are_reported_and_do_not_affect_others(self):
        with WebSocket(self.port, receive_buffer=2048) as slow:
            slow.receive()
            before = len(self.good.messages)
            # More data passes unread than the backlog and the socket buffers hold.
            end = time.monotonic() + PATIENCE_S
            while sum(len(m[1]) for m in self.good.messages[before:]) < 2_500_000:
                self.assertLess(time.monotonic(), end)
                time.sleep(0.2)
            kinds = collections.Counter()
            end = time.monotonic() + PATIENCE_S
            while not kinds["dropped"] and time.monotonic() < end:
                for text in texts_in([slow.receive()]):
                    kinds[text["type"]] += 1
                    if text["type"] == "dropped":
                        self.assertGreater(text["messages"], 100)
            self.assertEqual(kinds["dropped"], 1, "the loss was not reported")
            at = max(frames_in(self.good.messages[-50:]))
            first = min(frames_in(self.wait_for_frames(slow, 1), history=False))
            self.assertGreater(first, at - 1000, "frames after the loss are not live")

    def test_hundreds_of_half_open_requests_do_not_block_others(self):
        half = []
        self.addCleanup(lambda: [peer.close() for peer in half])
        for i in range(600):
            peer = connect(self.port)
            half.append(peer)
            try:
                peer.sendall(b"GET / HTTP/1.1\r\nHost: 127.0" if i % 2 else b"")
            except OSError:
                pass  # closed already
            if i % 100 == 50:
                self.assert_still_serves()
        # A request must be complete within seconds, even if it makes progress.
        end = time.monotonic() + PATIENCE_S
        left = set(half)
        while left and time.monotonic() < end:
            for peer in list(left):
                try:
                    peer.sendall(b"X")
                    peer.setblocking(False)
                    if peer.recv(1) == b"":
                        left.discard(peer)
                except BlockingIOError:
                    peer.settimeout(1)
                except OSError:
                    left.discard(peer)
            time.sleep(0.5)
        self.assertEqual(len(left), 0, "connections without a request are still open")

    def test_thousands_of_connections(self):
        for _ in range(30):
            wave = []
            for _ in range(100):
                try:
                    wave.append(connect(self.port, timeout=5))
                except OSError:
                    pass
            for peer in wave:
                peer.close()
        self.assert_still_serves()

    def test_the_number_of_pages_is_limited(self):
        streams = []
        self.addCleanup(lambda: [stream.close() for stream in streams])
        with self.assertRaises(Refused) as caught:
            for _ in range(200):
                streams.append(WebSocket(self.port))
        self.assertEqual(caught.exception.status, 503)
        self.assertGreaterEqual(len(streams), 20)
        self.assertEqual(self.get("/")[0], 200)
        while streams:
            streams.pop().close()
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            try:
                WebSocket(self.port).close()
                return
            except Refused:
                time.sleep(0.1)
        self.fail("closed pages still count")


class Token(Scope):
    options = ("--token", "s3cret.Word~1", "--allow-origin", "https://notes.lab", "--host-name", "rig.lab")

    def test_requests_without_the_token_are_refused(self):
        for query in ("", "?token=", "?token=s3cret", "?token=s3cret.Word~2", "?Token=s3cret.Word~1",
                      "?x=1&tokens=s3cret.Word~1", "?token=s3cret.Word~1x", "?token=" + "a" * 2000):
            with self.subTest(query=query[:40]):
                with self.assertRaises(Refused) as caught:
                    WebSocket(self.port, path="/stream" + query)
                self.assertEqual(caught.exception.status, 403)
                self.assertEqual(self.get("/" + query)[0], 403)
        self.assertEqual(self.get("/?token=s3cret.Word~1")[0], 200)
        self.assertEqual(self.get("/?theme=dark&token=s3cret.Word~1")[0], 200)
        self.assertEqual(self.get("/uPlot.esm.js")[0], 200)
        WebSocket(self.port, path="/stream?token=s3cret.Word~1").close()

    def test_declared_names_and_origins_are_accepted(self):
        path = "/stream?token=s3cret.Word~1"
        WebSocket(self.port, path=path, host="rig.lab", origin="https://rig.lab").close()
        WebSocket(self.port, path=path, host="rig.lab", origin="https://notes.lab").close()
        with self.assertRaises(Refused):
            WebSocket(self.port, path=path, host="rig.lab", origin="https://other.lab")


class Notes(Scope):
    def setUp(self):
        EndToEnd.setUp(self)
        self.socket = self.folder / "control.sock"
        self.log = self.folder / "run.log"
        self.daemon = self.start_daemon("--control", str(self.socket), "--record", str(self.log))
        self.server, self.port = self.start_scope("--allow-notes", "--socket", str(self.socket))

    def note(self, client, text):
        """The answer to a note, and the event that came with it."""
        client.send(frame(TEXT, json.dumps({"note": text}).encode()))
        answer = event = None
        end = time.monotonic() + PATIENCE_S
        while answer is None or (answer["taken"] and event is None):
            self.assertLess(time.monotonic(), end, f"{answer}, {event}")
            for message in texts_in([client.receive()]):
                if message["type"] == "note":
                    answer = message
                elif message["type"] == "event" and message["code"] == "note":
                    event = message
        return answer, event

    def test_a_note_from_a_page_is_recorded_and_sent_to_every_page(self):
        with WebSocket(self.port) as client, WebSocket(self.port) as other:
            self.wait_for_frames(client, 500)
            recorder = self.start_recorder("traffic.log")
            traffic = self.folder / "traffic.log"
            end = time.monotonic() + PATIENCE_S
            while not traffic.exists() or traffic.stat().st_size == 0:  # until it receives
                self.assertLess(time.monotonic(), end)
                time.sleep(0.05)
            answer, event = self.note(client, "weights: 450 g, µ <lower>")
            self.assertEqual((answer["taken"], answer["refusal"]), (True, ""))
            self.assertEqual((event["message"], event["severity"]), ("weights: 450 g, µ <lower>", 0))
            self.assertGreater(event["time_ns"], 0)
            seen = None
            end = time.monotonic() + PATIENCE_S
            while seen is None or seen["code"] != "note":
                self.assertLess(time.monotonic(), end)
                for message in texts_in([other.receive()]):
                    seen = message if message["type"] == "event" else seen
            self.assertEqual(seen, event)
            # One that the daemon refuses, with its reason.
            answer, _ = self.note(client, "x" * 600)
            self.assertFalse(answer["taken"])
            self.assertIn("500 bytes", answer["refusal"])
        with WebSocket(self.port) as late:
            events = [text for text in texts_in(self.wait_for_frames(late, 500)) if text["type"] == "event"]
            self.assertIn(event, events)
        self.assertEqual(self.stop(self.daemon), 0)
        self.assertEqual(self.stop(recorder), 0)
        event_t = generate_types(self.folder / "types").event_t
        for log in (self.log, traffic):
            events = [event_t.decode(payload) for payload in payloads(log, "STICKSLIP_EVENT")]
            self.assertEqual([(each.message, each.time_ns) for each in events if each.code == "note"],
                             [(event["message"], event["time_ns"])])

    def test_without_its_daemon_a_note_is_refused_and_rubbish_closes_the_stream(self):
        with WebSocket(self.port) as client:
            self.wait_for_frames(client, 100)
            self.assertEqual(self.stop(self.daemon), 0)
            answer, _ = self.note(client, "without a daemon")
            self.assertFalse(answer["taken"])
            self.assertIn("no daemon can be reached", answer["refusal"])
        for name, data in {"no note": frame(TEXT, b'{"not": "e"}'), "no JSON": frame(TEXT, b"hello"),
                           "binary": frame(BINARY, b'{"note": "a"}'), "long": frame(TEXT, b"x" * 3000),
                           "parts": frame(TEXT, b"x" * 1500, final=False) + frame(0, b"x" * 1500)}.items():
            with self.subTest(sent=name), WebSocket(self.port) as client:
                client.send(data)
                with self.assertRaises((Closed, ConnectionResetError, BrokenPipeError)):
                    end = time.monotonic() + PATIENCE_S
                    while time.monotonic() < end:
                        client.receive()

    def test_notes_about_another_rig_are_refused(self):
        other = self.folder / "other"
        shutil.copytree(SOURCE / "config", other)
        config = other / "simulated.toml"
        config.write_text(config.read_text().replace("simulated rig", "another rig"))
        with WebSocket(self.port) as client:
            self.wait_for_frames(client, 100)
            daemon = subprocess.Popen([STICKSLIPD, "--config", str(config), "--control", str(other / "control")],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(daemon.wait)
            self.addCleanup(daemon.kill)
            end = time.monotonic() + PATIENCE_S
            source = None
            while source is None:
                self.assertLess(time.monotonic(), end)
                for text in texts_in([client.receive()]):
                    found = [one["id"] for one in text.get("sources", []) if one["rig"] == "another rig"]
                    source = found[0] if found else source
        with WebSocket(self.port, path=f"/stream?source={source}") as client:
            self.wait_for_frames(client, 100)
            answer, _ = self.note(client, "to the wrong recording")
            self.assertIn("another rig", answer["refusal"])


class Replay(Scope):
    """A recording instead of the rig."""
    options = ("--token", "abc")

    def setUp(self):
        EndToEnd.setUp(self)
        self.log = self.folder / "run.log"
        folder = self.folder / "config"
        shutil.copytree(SOURCE / "config", folder)
        config = folder / "simulated.toml"
        config.write_text(config.read_text().replace("rate_hz = 1000.0", "rate_hz = 2000.0"))
        run = subprocess.run([STICKSLIPD, "--config", str(config), "--record", str(self.log), "--no-lcm",
                              "--duration", "4"], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.server, self.port = self.start_scope("--replay", str(self.log), *self.options)

    def ask(self, path):
        status, _, body = self.get(path)
        return status, body

    def test_summary_and_pieces_are_the_recording(self):
        status, body = self.ask("/recording?token=abc")
        self.assertEqual(status, 200)
        summary = json.loads(body)
        recorded = [frame for block in self.blocks() for frame in block]
        self.assertEqual(summary["frames"], len(recorded))
        self.assertEqual(int(summary["first_ns"]), recorded[0].time_ns)
        frames, types = [], set()
        for number in range(len(summary["pieces"])):
            status, body = self.ask(f"/recording/{number}?token=abc")
            self.assertEqual(status, 200)
            at = 0
            while at < len(body):
                size, binary = struct.unpack_from("<II", body, at)
                content = body[at + 8:at + 8 + size]
                at += 8 + size
                if binary:
                    column, _ = decoded(content)
                    frames += list(zip(*column[:2]))
                else:
                    types.add(json.loads(content)["type"])
        self.assertEqual(frames, [(frame.time_ns, frame.sequence) for frame in recorded])
        self.assertLessEqual({"estimate", "excitation", "status", "timing", "model", "event"}, types)
        with WebSocket(self.port, path="/stream?token=abc") as client:
            hello = texts_in([client.receive()])[0]
            self.assertTrue(hello["recording"])
            self.assertFalse(hello["notes"])

    def blocks(self):
        block_t = generate_types(self.folder / "types").frame_block_t
        return [frames_of_block(block_t.decode(payload)) for payload in payloads(self.log, "STICKSLIP_FRAMES")]

    def test_pieces_need_the_token_and_exist(self):
        self.assertEqual(self.ask("/recording")[0], 403)
        self.assertEqual(self.ask("/recording/0")[0], 403)
        for path in ("/recording/99", "/recording/-1", "/recording/0x", "/recording/", "/recordings", "/recording0"):
            self.assertEqual(self.ask(path + "?token=abc")[0], 404, path)

    def test_what_is_no_log_is_refused_in_one_line(self):
        csv = self.write("run.csv", "time_s,velocity_m_s\n1,2\n")
        for file, words in ((csv, "stickslip convert"), (self.folder / "none.log", "none.log")):
            result = subprocess.run([STICKSLIP, "scope", "--listen", "127.0.0.1:0", "--replay", str(file)],
                                    capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(result.returncode, 2)
            self.assertRegex(result.stderr, rf"\A[^\n]*{words}[^\n]*\n\Z")


class OtherNetwork(Scope):
    """The page in this network namespace, LCM in that of the daemon, as in tools/demo."""

    def setUp(self):
        self.daemon = subprocess.Popen([SOURCE / "tools/own-network", STICKSLIPD, "--config", str(RIG)],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(self.daemon.wait)
        self.addCleanup(self.daemon.kill)
        end = time.monotonic() + PATIENCE_S
        while os.readlink(f"/proc/{self.daemon.pid}/exe") != os.path.realpath(STICKSLIPD):
            self.assertLess(time.monotonic(), end)
            time.sleep(0.05)
        self.options = ("--network-of", str(self.daemon.pid))
        super().setUp()

    def test_frames_are_received(self):
        with WebSocket(self.port) as client:
            self.assertGreater(len(frames_in(self.wait_for_frames(client, 100))), 99)


@needs_page
class Arguments(EndToEnd):
    def scope(self, *options):
        return subprocess.run([STICKSLIP, "scope", *options], capture_output=True, text=True, timeout=PATIENCE_S)

    def test_errors_are_reported_in_one_line(self):
        for options, words in {("--listen", "localhost:80"): "127.0.0.1:8088",
                               ("--listen", "192.0.2.1:0"): "ip address",
                               ("--token", "a b"): "letters",
                               ("--history", "-1"): "0 to 3600",
                               ("--model", "nothing.toml"): "nothing.toml",
                               ("--pages", "0"): "1 to 500",
                               ("--listen", "127.0.0.1:0", "--network-of", "2147483647"): "no such process",
                               ("--url", "http://x", "--listen", "127.0.0.1:0"): "udpm://"}.items():
            with self.subTest(options=options):
                result = self.scope(*options)
                self.assertIn(result.returncode, (1, 2))
                self.assertEqual(result.stdout, "")
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                self.assertIn(words, result.stderr)

    def test_a_taken_port_is_reported(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            result = self.scope("--listen", f"127.0.0.1:{other.getsockname()[1]}")
        self.assertEqual(result.returncode, 1)
        self.assertIn("another program", result.stderr)

    def test_all_addresses_need_a_token_and_the_printed_ones_work(self):
        for everywhere in ("0.0.0.0:0", "[::]:0"):
            result = self.scope("--listen", everywhere)
            self.assertEqual((result.returncode, result.stdout), (2, ""))
            self.assertRegex(result.stderr, r"\A[^\n]*add --token WORD[^\n]*\n\Z")
        # An address besides loopback, in this test's own network.
        subprocess.run(["ip", "address", "add", "192.0.2.7/32", "dev", "lo"], check=True)
        server = subprocess.Popen([STICKSLIP, "scope", "--listen", "0.0.0.0:0", "--token", "abc"],
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        lines = [server.stdout.readline() for _ in range(2)]
        self.assertRegex(lines[0], r"\Alive view: http://127\.0\.0\.1:\d+/\?token=abc\n")
        self.assertRegex(lines[1], r"\Afrom other machines: http://192\.0\.2\.7:\d+/\?token=abc\n")
        for line in lines:
            with urllib.request.urlopen(line.split(": ", 1)[1].strip(), timeout=PATIENCE_S) as answer:
                self.assertEqual(answer.status, 200)
        server.send_signal(signal.SIGTERM)
        _, errors = server.communicate(timeout=PATIENCE_S)
        self.assertEqual(server.returncode, 0)
        self.assertIn("nothing is encrypted", errors)


if __name__ == "__main__":
    main()
