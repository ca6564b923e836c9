# SPDX-License-Identifier: Apache-2.0
"""A WebSocket client (RFC 6455) that can also violate the protocol."""
import base64
import os
import socket
import struct
import time

TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10
SUBPROTOCOL = "stickslip-scope"


class Refused(Exception):
    """The server did not open the stream. `status`: of HTTP; 0 if it only closed the connection."""

    def __init__(self, status, answer):
        super().__init__(f"{status}: {answer[:300]!r}")
        self.status = status
        self.answer = answer


class Closed(Exception):
    """The server closed the stream. `code`: of its close frame; None if there was none."""

    def __init__(self, code, reason=""):
        super().__init__(f"{code} {reason}")
        self.code = code


def connect(port, timeout=10.0, address="127.0.0.1", receive_buffer=None):
    """A TCP connection. With a small `receive_buffer` back pressure sets in immediately."""
    out = socket.socket()
    if receive_buffer:
        out.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    out.settimeout(timeout)
    out.connect((address, port))
    return out


def handshake(port, path="/stream", host=None, origin=None, subprotocol=SUBPROTOCOL, extra=()):
    lines = [f"GET {path} HTTP/1.1", f"Host: {host or f'127.0.0.1:{port}'}", "Upgrade: websocket",
             "Connection: Upgrade", f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}",
             "Sec-WebSocket-Version: 13"]
    if subprotocol:
        lines.append(f"Sec-WebSocket-Protocol: {subprotocol}")
    if origin:
        lines.append(f"Origin: {origin}")
    return ("\r\n".join([*lines, *extra]) + "\r\n\r\n").encode()


def frame(opcode, payload=b"", final=True, masked=True, claimed=None):
    """A frame from a client. `claimed`: a wrong length for the header."""
    size = len(payload) if claimed is None else claimed
    head = bytes([(0x80 if final else 0) | opcode])
    mask_bit = 0x80 if masked else 0
    if size < 126:
        head += bytes([mask_bit | size])
    elif size < 1 << 16:
        head += bytes([mask_bit | 126]) + struct.pack(">H", size)
    else:
        head += bytes([mask_bit | 127]) + struct.pack(">Q", size)
    if not masked:
        return head + payload
    key = os.urandom(4)
    return head + key + bytes(byte ^ key[i % 4] for i, byte in enumerate(payload))


class WebSocket:
    """An open stream. `receive` returns (opcode, payload) of whole messages."""

    def __init__(self, port, timeout=10.0, receive_buffer=None, **request):
        self.socket = connect(port, timeout, receive_buffer=receive_buffer)
        self.buffer = bytearray()
        try:
            self.socket.sendall(handshake(port, **request))
            self.answer = self._head()
            status = int(self.answer.split(b" ", 2)[1]) if self.answer.startswith(b"HTTP/") else 0
            if status != 101:
                raise Refused(status, self.answer + bytes(self.buffer))
        except OSError as error:
            self.socket.close()
            raise Refused(0, str(error).encode()) from error
        except Refused:
            self.socket.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.socket.close()

    def send(self, data):
        self.socket.sendall(data)

    def _more(self):
        data = self.socket.recv(1 << 16)
        if not data:
            raise Closed(None)
        self.buffer += data

    def _head(self):
        while (end := self.buffer.find(b"\r\n\r\n")) < 0:
            try:
                self._more()
            except Closed:
                raise Refused(0, bytes(self.buffer)) from None
        head = bytes(self.buffer[:end + 4])
        del self.buffer[:end + 4]
        return head

    def _take(self, size):
        while len(self.buffer) < size:
            self._more()
        out = bytes(self.buffer[:size])
        del self.buffer[:size]
        return out

    def _frame(self):
        first, second = self._take(2)
        if second & 0x80 or first & 0x70:
            raise ValueError("frame from the server is masked or has reserved bits set")
        size = second & 0x7F
        if size == 126:
            size = struct.unpack(">H", self._take(2))[0]
        elif size == 127:
            size = struct.unpack(">Q", self._take(8))[0]
        return first & 0x0F, bool(first & 0x80), self._take(size)

    def receive(self):
        """The next message. Answers pings. Raises Closed or TimeoutError."""
        whole, kind = b"", None
        while True:
            opcode, final, payload = self._frame()
            if opcode == CLOSE:
                code = struct.unpack(">H", payload[:2])[0] if len(payload) >= 2 else None
                raise Closed(code, payload[2:].decode(errors="replace"))
            if opcode == PING:
                self.send(frame(PONG, payload))
                continue
            if opcode == PONG:
                continue
            kind = kind or opcode
            whole += payload
            if final:
                return kind, whole

    def receive_for(self, seconds):
        """All messages within a duration."""
        end = time.monotonic() + seconds
        out = []
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                out.append(self.receive())
            except TimeoutError:
                break
        return out
