"""Addresses of computers."""
import ipaddress
from typing import Any


def ip_of(text: str) -> Any:
    """Return an IP address, or None for a name; an IPv4 address that came to an IPv6 socket is one
    of IPv4."""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def is_loopback(host: str) -> bool:
    """Return whether an address is this computer's alone."""
    address = ip_of(host)
    return host == "localhost" if address is None else address.is_loopback
