"""Groot2, as far as the wire can tell."""
import json
import struct

import zmq


class Client:
    """Groot2, as far as the wire can tell."""

    def __init__(self, port):
        self.context = zmq.Context()
        self.requests = self.context.socket(zmq.REQ)
        self.news = self.context.socket(zmq.SUB)
        for sock in (self.requests, self.news):
            sock.setsockopt(zmq.LINGER, 0)
            sock.setsockopt(zmq.RCVTIMEO, 5000)
        self.news.subscribe(b"")
        self.requests.connect("tcp://127.0.0.1:{}".format(port))
        self.news.connect("tcp://127.0.0.1:{}".format(port + 1))

    def raw(self, *frames):
        self.requests.send_multipart(list(frames))
        return self.requests.recv_multipart()

    def ask(self, kind, payload=None):
        """Return the payload of a reply, or the text of an error."""
        frames = [struct.pack("<BBI", 2, ord(kind), 7)
                  ] + ([payload.encode()] if payload is not None else [])
        reply = self.raw(*frames)
        if reply[0] == b"error":
            return reply[1].decode()
        assert reply[0][:6] == frames[0] and len(reply[0]) == 22
        self.uuid = reply[0][6:]
        return reply[1] if len(reply) > 1 else None

    def statuses(self):
        data = self.ask("S")
        return dict(struct.unpack_from("<HB", data, place) for place in range(0, len(data), 3))

    def close(self):
        self.context.destroy(0)


def hook(uid, position=0, mode=1, once=False, enabled=True, status="SUCCESS"):
    return json.dumps({"enabled": enabled, "uid": uid, "mode": mode, "once": once,
                       "desired_status": status, "position": position})
