"""What all answers of the page's server have in common: who may ask, and what a browser may do with
them."""
import socket
from typing import Any, Set, cast

import msgspec
from tornado.http1connection import HTTP1Connection
from tornado.httputil import HTTPServerRequest, split_host_and_port
from tornado.iostream import IOStream
from tornado.web import RequestHandler

from behavior_controller.viewer.addresses import ip_of, is_loopback


def host_names(address: str) -> Set[str]:
    """Return the names, besides localhost, under which a browser may ask for the page."""
    own = socket.gethostname().lower()
    names = {address} if ip_of(address) is None else set()
    if is_loopback(address):
        return names
    return names | {own, own + ".local"}


def stream_of(request: HTTPServerRequest) -> IOStream:
    """Return the connection that a request came on."""
    return cast(HTTP1Connection, request.connection).stream


class PageAnswer(RequestHandler):
    """The common part of all answers."""

    def note_use(self) -> None:
        """Keep the connection's place."""
        self.settings["connections"].use(stream_of(self.request))

    def prepare(self) -> None:
        """Refuse a request for another computer's name.

        A foreign site can point a name of its own at this computer and then read, in the operator's
        browser, whatever answers to that name (DNS rebinding). So the page answers to no name that
        it does not know to be this computer's.
        """
        self.note_use()
        if not self._is_for_this_computer():
            self.refuse(403, "This page answers to the address of its computer and to localhost, "
                             "and to the name that monitorAddress gives, but not to the name that "
                             "was asked for.")

    def refuse(self, status: int, why: str) -> None:
        """Answer with why nothing else is sent."""
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(why + "\n")

    def send(self, data: Any) -> None:
        """Answer with data as JSON."""
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.write(msgspec.json.encode(data))

    def _is_for_this_computer(self) -> bool:
        """Whether the host that is asked for is the address that the request came to, or a name of
        this computer."""
        asked = self.request.headers.get("Host", "").lower()
        host = split_host_and_port(asked)[0].strip("[]")
        if host in self.settings["host_names"] or is_loopback(host):
            return True
        stream = stream_of(self.request)
        if stream.closed() or ip_of(host) is None:
            return False
        return ip_of(host) == ip_of(stream.socket.getsockname()[0].split("%")[0])

    def set_default_headers(self) -> None:
        """Forbid content from other sites, caching, and frames of other pages around this one."""
        self.set_header("Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'")
        self.set_header("X-Frame-Options", "DENY")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")
