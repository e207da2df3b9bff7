"""Finds what other ROS packages add to the controller: the Python modules that they export to it in their package.xml.

``<export><cssr_system leaves="my_robot.leaves" interface="my_robot.interface" phrases="my_robot.phrases"/></export>``
in the form of rqt and pluginlib. Without ROS no such packages are found.
"""
import functools
import importlib
import os
from types import ModuleType
from typing import Any, Dict, Iterator, NamedTuple, Tuple
from xml.etree import ElementTree

TARGET = "cssr_system"

KINDS = {"leaves": ("SPECS",), "interface": ("SERVICES", "TOPICS"), "phrases": ("SPEECHES",)}
"""Attribute of the export -> the tuples that the module may have; it needs at least one of them."""


class BrokenExtension(ImportError):
    """An export of another package cannot be used; the text names the package and says what to do."""


class Extension(NamedTuple):
    """A module that a package exports, and the package's folder."""

    package: str
    folder: str
    module: ModuleType

    def declared(self, name: str) -> Tuple[Any, ...]:
        """Return the tuple of that name in the module; empty if it has none."""
        return tuple(getattr(self.module, name, ()))

    def broken(self, text: str) -> BrokenExtension:
        """Return an error that names the module."""
        return BrokenExtension("package {}, {}: {}".format(self.package, self.module.__name__, text))


@functools.lru_cache(maxsize=None)
def found(kind: str) -> Tuple[Extension, ...]:
    """Return the modules of a kind, by the name of their package. Raises BrokenExtension."""
    return tuple(_loaded(package, folder, kind, modules[kind])
                 for package, folder, modules in _exports() if kind in modules)


def _loaded(package: str, folder: str, kind: str, name: str) -> Extension:
    try:
        module = importlib.import_module(name)
    except Exception as error:  # a foreign module may raise anything
        raise BrokenExtension("package {} exports {}=\"{}\", which cannot be imported: {}: {}".format(
            package, kind, name, type(error).__name__, error)) from error
    extension = Extension(package, folder, module)
    for wanted in KINDS[kind]:
        if not isinstance(getattr(module, wanted, ()), (tuple, list)):
            raise extension.broken("{} is not a tuple".format(wanted))
    if not any(hasattr(module, wanted) for wanted in KINDS[kind]):
        raise extension.broken("it has no {}".format(" and no ".join(KINDS[kind])))
    return extension


@functools.lru_cache(maxsize=None)
def _exports() -> Tuple[Tuple[str, str, Dict[str, str]], ...]:
    return tuple(sorted(_read_exports(), key=lambda export: export[0]))


def _read_exports() -> Iterator[Tuple[str, str, Dict[str, str]]]:
    """Yield package, folder and the modules of each package that exports some to us."""
    try:
        import rospkg
    except ImportError:
        return
    packages = rospkg.RosPack()
    for package in packages.list():
        folder = packages.get_path(package)
        manifest = os.path.join(folder, "package.xml")
        for element in _export_elements(manifest):
            for attribute in element.attrib:
                if attribute not in KINDS:
                    raise BrokenExtension("{}: {} takes nothing called {}; it takes {}".format(
                        manifest, TARGET, attribute, ", ".join(KINDS)))
            yield package, folder, dict(element.attrib)


def _export_elements(manifest: str) -> Iterator[ElementTree.Element]:
    try:
        with open(manifest, encoding="utf-8") as file:
            text = file.read()
        # most packages export nothing to us, and need no parsing
        root = ElementTree.fromstring(text) if "<" + TARGET in text else None
    except (OSError, ValueError, ElementTree.ParseError):
        return  # rospack reports it
    if root is not None:
        yield from root.findall("export/" + TARGET)
