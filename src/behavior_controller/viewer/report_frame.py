"""The frame of every report: one HTML file that needs nothing else, with the page's look."""
import base64
import hashlib
import os
from typing import Any, Dict, Sequence

from tornado.template import Template

_FOLDER = os.path.dirname(os.path.abspath(__file__))


def framed(generator: str, title: str, heads: Sequence[str], sections: Dict[str, str],
           content: str, script: str = "", data: str = "") -> str:
    """Return the page; ``generator`` is the command that makes it, ``content`` is HTML that has the
    ``sections`` with these ids, and ``data`` is JSON for the script."""
    page = Template(file_text("report_files", "frame.html")).generate(
        checksum=_checksum, style=file_text("page_files", "style.css"), title=encodable(title),
        generator=generator, heads=list(map(encodable, heads)), sections=sections,
        content=content, script=script, data=data)
    return page.decode()


def encodable(value: Any) -> str:
    """Return a value as text that a file can hold; half a surrogate pair is escaped."""
    return str(value).encode("utf-8", "backslashreplace").decode("utf-8")


def file_text(folder: str, name: str) -> str:
    """Return the text of a file beside this module."""
    with open(os.path.join(_FOLDER, folder, name), encoding="utf-8") as file:
        return file.read()


def _checksum(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return "sha256-" + base64.b64encode(digest).decode("ascii")
