"""Finds what other ROS packages add to the controller: the Python modules that they export to it in
their package.xml.

``<export><cssr_system leaves="my_robot.leaves" interface="my_robot.interface"
phrases="my_robot.phrases"/></export>`` in the form of rqt and pluginlib.
"""
import contextlib
import functools
import importlib
import os
import re
import reprlib
import sys
import threading
import time
import traceback
from types import FrameType, ModuleType
from typing import Any, Dict, List, NamedTuple, Optional, Tuple
from xml.etree import ElementTree

from behavior_controller import exit_codes
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.foreign_code import described, place
from behavior_controller.interpreter import frame_of
from behavior_controller.ros_packages import MANIFEST, package_folders, package_name
from behavior_controller.text import Unreadable, bracketed, did_you_mean, read_bytes

TARGET = "cssr_system"

EXPORTS = {"leaves": ("SPECS",), "interface": ("SERVICES", "TOPICS"), "phrases": ("SPEECHES",)}
"""Attribute of the export -> the tuples that the module may have; it needs at least one of them."""

PLAIN: Dict[Any, Tuple[type, ...]] = {
    str: (str,), bool: (bool,), int: (int,), float: (int, float), Tuple[str, ...]: (list, tuple)}
"""Types of fields that are checked, each with the types of values that it may have."""

CODE_LIMIT = 15.0
"""Seconds after which a command gives up code of another package that has not returned, and ends.
"""

WATCH_INTERVAL = 0.25
"""Seconds between two looks at that code."""

doubts: List[Fault] = []
"""A warning for each package.xml, of those read so far, that may export something and cannot be
read."""

_EXPORT = re.compile(rb"<([\w.-]+)\s[^<>]*\b(?:leaves|interface|phrases)\s*=")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)

_under_way: List[Tuple[str, str]] = []  # the import that has not ended: package, export
_watched: List[int] = []  # the thread that is watched from the first import on
_packages: Dict[str, str] = {}  # the package that exports a Python package


class BrokenExtension(ConfigurationError):
    """An export of another package cannot be used; the text names the package and says what to do.
    """

    def __init__(self, package: str, text: str):
        super().__init__([Fault(f"package {package}", 0, 0, text)])


class Extension(NamedTuple):
    """A module that a package exports, and the package's folder."""

    package: str
    folder: str
    module: ModuleType

    def declared(self, name: str, kind: type) -> Tuple[Any, ...]:
        """Return the tuple of that name in the module; empty if it has none. Raises
        BrokenExtension.

        Its items must be of that ``kind``, with plain fields of the annotated types.
        """
        items = getattr(self.module, name, ())
        for item in items:
            if not isinstance(item, kind):
                shown = reprlib.repr(getattr(item, "name", item))
                raise self.broken(f"{shown} in {name} is not a {kind.__name__}", name)
            for field, wanted in kind.__annotations__.items():
                value = getattr(item, field)
                if wanted in PLAIN and not isinstance(value, PLAIN[wanted]):
                    raise self.broken(f"the {field} of a {kind.__name__} is {value!r}, and not of "
                                      f"the type {PLAIN[wanted][-1].__name__}", repr(value), name)
        return tuple(items)

    def broken(self, text: str, *near: str) -> BrokenExtension:
        """Return an error that names the module, with the line that has one of the texts ``near``,
        the first that it finds."""
        name, file = self.module.__name__, getattr(self.module, "__file__", None) or ""
        lines: List[str] = []
        with contextlib.suppress(Unreadable):
            lines = read_bytes(file).decode(errors="replace").splitlines()
        where = next((bracketed(place(file, number)) for wanted in near
                      for number, line in enumerate(lines, 1) if wanted in line), "")
        return BrokenExtension(self.package, f"{name}: {text}{where}")


def quoted(name: str) -> Tuple[str, str]:
    """Return a name as it stands in Python."""
    return f'"{name}"', f"'{name}'"


@functools.lru_cache(maxsize=None)
def exported(kind: str) -> Tuple[Extension, ...]:
    """Return the modules of a kind, by the name of their package. Raises BrokenExtension."""
    return tuple(_loaded(package, folder, kind, module)
                 for package, folder, exported_kind, module in _exports() if exported_kind == kind)


def late(seconds: float, frame: Optional[FrameType] = None) -> Optional[BrokenExtension]:
    """Return the error of the import that has not ended after ``seconds``, or of other code of an
    extension.

    ``frame`` is where the work has got to. None if no extension holds it up.
    """
    frames = frames_of_packages(frame)
    where = place(frames[0].f_code.co_filename, frames[0].f_lineno) if frames else ""
    if _under_way:
        package, export = _under_way[0]
        return BrokenExtension(package, f"{export}: its import has not ended within {seconds:g} s"
                                        + bracketed(where))
    if frames:
        return BrokenExtension(
            _package_of(frames[0]) or "", f"{where} has not returned within {seconds:g} s")
    return None


def frames_of_packages(frame: Optional[FrameType]) -> List[FrameType]:
    """Return the calls of extensions' code that are under way, the innermost first."""
    return [caller for caller, _ in (traceback.walk_stack(frame) if frame is not None else ())
            if _package_of(caller) is not None]


def watch() -> None:
    """End the program with a line if code of an extension on this thread, from its import on, has
    not returned after ``CODE_LIMIT``."""
    _watched[:] = [threading.get_ident()]


def _watch(thread: int) -> None:
    before: object = None
    checks = 0  # counted, not timed: a machine may have been suspended
    error: Optional[BrokenExtension] = None
    while error is None:
        time.sleep(WATCH_INTERVAL)
        frame = frame_of(thread)
        under_way = (*_under_way, *frames_of_packages(frame)[-1:])[:1]
        checks = checks + 1 if under_way and under_way == before else 0
        before = under_way
        if checks * WATCH_INTERVAL >= CODE_LIMIT:
            error = late(CODE_LIMIT, frame)
    line = f"{os.path.basename(sys.argv[0])}: {error}\n"
    os.write(2, line.encode("utf-8", "backslashreplace"))
    os._exit(exit_codes.WRONG_INPUT)


def thread_failure(error: BaseException) -> Optional[BrokenExtension]:
    """Return the error of an extension whose code has ended a thread by raising ``error``; None if
    no extension's code has."""
    packages = [_package_of(frame) for frame, _ in traceback.walk_tb(error.__traceback__)]
    package = next(filter(None, packages), None)
    if package is None or isinstance(error, SystemExit):  # Python's way to end a thread
        return None
    return BrokenExtension(package, f"a thread of its code has failed: {described(error)}")


def _package_of(frame: FrameType) -> Optional[str]:
    return _packages.get(frame.f_globals.get("__name__", "").partition(".")[0])


def _loaded(package: str, folder: str, kind: str, name: str) -> Extension:
    export = f'{kind}="{name}"'
    if not name:
        raise BrokenExtension(package, f"{export} names no module")
    try:
        module = _imported(package, export, name)
        values = {
            wanted: getattr(module, wanted) for wanted in EXPORTS[kind] if hasattr(module, wanted)}
    except BaseException as error:  # a foreign module may raise anything
        hint = ""
        if kind == "interface" and "partially initialized" in str(error):
            hint = "; this module must not import leaves or phrases"
        raise BrokenExtension(
            package, f"{export} cannot be imported: {described(error)}{hint}") from error
    extension = Extension(package, folder, module)
    for wanted, value in values.items():
        if not _is_list(value):
            raise extension.broken(
                f"{wanted} is not a tuple; with one item it needs a comma: {wanted} = (…,)", wanted)
    lacking = [wanted for wanted in EXPORTS[kind] if wanted not in values]
    near = [other for other, value in vars(module).items() if did_you_mean(other, lacking, 0.8)
            and (_is_list(value) or not values and other.isupper())]
    if near or not values:
        raise extension.broken("it has no {}{}".format(
            " and no ".join(lacking), ", but " + near[0] if near else ""), *near)
    return extension


def _is_list(value: object) -> bool:
    """Whether it is a tuple of records. A single record is a tuple too, of its fields."""
    return isinstance(value, (tuple, list)) and not hasattr(value, "_fields")


def _imported(package: str, export: str, name: str) -> ModuleType:
    """Import a module on this thread; others would have to wait for each other's imports."""
    _under_way[:] = [(package, export)]
    _packages[name.partition(".")[0]] = package
    with contextlib.suppress(RuntimeError):  # no thread is left: nothing is watched
        if _watched:
            threading.Thread(target=_watch, args=(_watched.pop(),), daemon=True).start()
    try:
        return importlib.import_module(name)
    finally:
        _under_way.clear()


@functools.lru_cache(maxsize=None)
def _exports() -> Tuple[Tuple[str, str, str, str], ...]:
    """Return package, folder, kind and module of each export to us, by package; the first package
    of a name counts."""
    doubts.clear()
    exports: Dict[str, List[Tuple[str, str, str, str]]] = {}
    for folder in package_folders():
        path = os.path.join(folder, MANIFEST)
        try:
            manifest = read_bytes(path)
        except Unreadable as error:
            _doubt(folder, f"cannot be read: {error}")
            continue
        name = package_name(manifest) or os.path.basename(folder)
        if name not in exports:
            exports[name] = [(name, folder, *export) for export in _modules(name, path, manifest)]
    return tuple(export for name in sorted(exports) for export in exports[name])


def _modules(package: str, path: str, manifest: bytes) -> List[Tuple[str, str]]:
    """Return kind and module of each export to us in a package.xml. Most packages have none, and
    need no parsing."""
    # lines and columns stay as they are
    manifest = _COMMENT.sub(lambda comment: re.sub(rb"\S", b" ", comment.group()), manifest)
    exports = b"<" + TARGET.encode() in manifest
    other = _EXPORT.search(manifest)
    if other is not None and did_you_mean(other.group(1).decode(), [TARGET]) and not exports:
        raise BrokenExtension(
            package, "{}:{}: the export element {} is unknown, did you mean {}?".format(
                path, manifest.count(b"\n", 0, other.start()) + 1, other.group(1).decode(), TARGET))
    if not exports and (b"</export>" in manifest or b"</package>" in manifest):
        return []
    try:
        root = ElementTree.fromstring(manifest)
    except (ValueError, LookupError, ElementTree.ParseError) as error:
        if exports:
            raise BrokenExtension(package, f"{path} is not XML: {error}") from error
        _doubt(os.path.dirname(path), f"is not XML: {error}")
        return []
    elements = root.findall("export/" + TARGET)
    if not elements and root.find(".//" + TARGET) is not None:
        raise BrokenExtension(package, f"{path}: <{TARGET}> must stand in <export>")
    modules = [export for element in elements for export in element.attrib.items()]
    for attribute, _ in modules:
        if attribute not in EXPORTS:
            raise BrokenExtension(package, f"{path}: {TARGET} has no attribute {attribute}; "
                                           f"allowed: {', '.join(EXPORTS)}")
    return modules


def _doubt(folder: str, text: str) -> None:
    """Warn of a package.xml that does not show whether it exports something."""
    doubts.append(Fault(
        "package " + os.path.basename(folder), 0, 0,
        f"{os.path.join(folder, MANIFEST)} {text}; what it exports is left out", is_warning=True))
