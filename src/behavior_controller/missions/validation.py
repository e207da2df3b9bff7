"""Checks an author's files: single missions, projects, folders, with palettes for other robots."""
import contextlib
import os
import re
from dataclasses import dataclass, field, replace
from typing import Collection, Dict, Iterable, Iterator, List, Optional, Set, Tuple, Union

from behavior_controller import folders, leaves
from behavior_controller.config import knowledge_files, settings
from behavior_controller.config.knowledge_files import Knowledge
from behavior_controller.bt.loader import rules
from behavior_controller.bt.linter.palette import (
    check_models, is_palette, models, stubs, used_types)
from behavior_controller.bt.loader.structure import Findings, by_place
from behavior_controller.bt.loader.document import Document, included_path, read, with_includes
from behavior_controller.errors import ConfigurationError, Fault, MissionError, attempt
from behavior_controller.missions.load import (
    POLICY, build_tree, find, keys_without_meaning, on_robot, robot_files)
from behavior_controller.text import Unreadable, clean, count, first_names, read_text

ENDINGS = (".xml", ".btproj")
_PERHAPS_MISSION = re.compile(r"<(?:root|BehaviorTree|TreeNodesModel)\b")


@dataclass
class Judgement:
    """The result of checking one file and the files that it includes."""

    file: str
    faults: List[Fault] = field(default_factory=list)
    nodes: int = 0  # of the unfolded trees, if they have no fault
    stubs: Tuple[str, ...] = ()
    others: Tuple[str, ...] = ()  # of the stubs, those that this robot has too, as another node
    mains: Tuple[str, ...] = ()  # if more than one, each was checked as a main tree
    palette: Optional[int] = None  # node types of a file that contains only a palette
    part_of: str = ""

    @property
    def is_wrong(self) -> bool:
        """Return whether the file has a fault."""
        return any(not fault.is_warning for fault in self.faults)

    def __str__(self) -> str:
        """Return the line that summarises the result."""
        if self.part_of:
            return f"{clean(self.file)}: a part of {clean(self.part_of)}"
        warnings = sum(fault.is_warning for fault in self.faults)
        counts = [count(warnings, "warning")]
        if not self.is_wrong and self.palette is not None:
            counts.insert(0, f"a palette of {count(self.palette, 'node type')}")
        elif self.is_wrong or not self.nodes:
            counts = counts if warnings else []
            counts.insert(0, count(len(self.faults) - warnings, "error"))
        else:
            done = "checked" if self.stubs else "can be run"
            if len(self.mains) > 1:
                done += f" from each of {', '.join(map(clean, self.mains))}"
            counts[:0] = [done, count(self.nodes, "node")]
        line = f"{clean(self.file)}: {', '.join(counts)}"
        if self.stubs:
            lacking = count(len(self.stubs), "node type")
            line += (f"; not a mission of this robot, which lacks {lacking} (taken as stubs): "
                     f"{first_names(map(clean, self.stubs))}")
        if self.others:
            line += f"; defined by the palette, not as here: {first_names(map(clean, self.others))}"
        return line


class Validation:
    """A check of files. ``main`` names the main tree, ``palettes`` are files with further node
    types, ``ignored`` are codes of warnings that are left out; ``in_folder``: trees that a file
    lacks are taken from the other files of its folder. ``robot`` overrides the configuration.
    """

    def __init__(self, main: Optional[str] = None, palettes: Collection[str] = (),
                 ignored: Collection[str] = (), in_folder: bool = False, robot: str = ""):
        """Raise BrokenExtension if what a package exports cannot be used."""
        self.main, self.palettes = main, palettes
        self.ignored, self.in_folder = ignored, in_folder
        faults: List[Fault] = []
        file = folders.config(settings.FILE_NAME)
        self.files = {file, folders.config(POLICY)}
        """The files whose contents decide the judgements, also those that are missing."""
        chosen, said_by = None, "by default"
        if os.path.lexists(file):
            chosen = attempt(lambda: settings.load(file), faults)
        if chosen:
            said_by = file
        if faults:
            said_by += ": the configuration has mistakes"
        self._settings = chosen or settings.defaults()
        is_configured = robot in ("", self._settings.robot_interface)
        if robot:
            self._settings, said_by = replace(self._settings, robot_interface=robot), "--interface"
        self.head = f"checked for the robot {self._settings.robot_interface} ({said_by})"
        """The line that says for which robot the files are checked."""
        known = self._known("", faults)
        if is_configured:  # else its keys are for another robot
            faults += keys_without_meaning(self._settings, known)
        self._configuration: Dict[str, List[Fault]] = {}  # the faults of each of its files
        for fault in faults:
            self._configuration.setdefault(fault.file, []).append(fault)

    def judge(self, paths: Iterable[str]) -> Iterator[Judgement]:
        """Yield a judgement for the configuration if it is faulty, then for each file; a folder
        means all its files, and a name a mission of a data folder."""
        yield from (Judgement(file, faults) for file, faults in self._configuration.items())
        files = self._files(paths)
        missions = {path: read_one for path, read_one in files.items()
                    if not isinstance(read_one, Judgement)}
        whole = missions
        if self.in_folder:
            whole = {path: _completed(documents) for path, documents in missions.items()}
        for documents in whole.values():
            self.files.update(_watched(documents, self.in_folder))
        taken = _taken(missions, whole)
        parts = {path: owner for path, owner in _parts(whole).items()
                 if _is_taken(missions[path][-1], taken[path])}
        parts.update(_parts(missions))
        palettes = [documents[-1] for path, documents in missions.items()
                    if is_palette(documents) or path in self.palettes]
        has_main = any(self.main in _trees(documents) for documents in whole.values())
        for path, read_one in files.items():
            if isinstance(read_one, Judgement):
                yield read_one
            elif path in parts:
                yield Judgement(path, part_of=parts[path])
            elif is_palette(read_one):
                yield self._palette(path, read_one)
            elif path not in self.palettes:
                main = self.main if not has_main or self.main in _trees(whole[path]) else None
                yield self._mission(path, whole[path], palettes, main, taken[path])

    def _files(self, paths: Iterable[str]) -> Dict[str, Union[Judgement, List[Document]]]:
        """Return the documents of each mission and palette, a file after all that it includes; of
        any other file what is wrong."""
        files = {path: self._read(path) for path in self.palettes}
        for path in paths:
            try:
                for file in expanded(named(path)):
                    files[file] = self._read(file)
            except ConfigurationError as error:
                self.files.add(folders.mission(path))
                files[path] = Judgement(path, [fault._replace(
                    file=path, code=rules.UNREADABLE_FILE.code) for fault in error.faults])
        return files

    def _read(self, path: str) -> Union[Judgement, List[Document]]:
        """Return the documents of a mission or a palette; of any other file what is wrong."""
        if os.path.isdir(path):
            return Judgement(path, [Fault(path, 0, 0, "the folder has no mission",
                                          f"a mission ends with {' or '.join(ENDINGS)}",
                                          code=rules.UNREADABLE_FILE.code)])
        knowledge = knowledge_files.check(path, self._settings.interface.takes_arm)
        if knowledge is not None:
            return Judgement(path, knowledge)
        try:
            return with_includes(read(path))
        except MissionError as error:
            return Judgement(path, self._reported(error.faults))

    def _known(self, mission: str, faults: List[Fault]) -> Optional[Knowledge]:
        """Return what the robot knows in a mission, if files say that; add what is wrong with them,
        and with the phrases and the policy, to ``faults``."""
        known, spoken, _ = robot_files(self._settings, mission, faults)
        if known is not None:
            self.files.update(source.file for source in known.sources)
        if spoken is not None:
            self.files.add(spoken.source.file)
        return known

    def _reported(self, faults: Iterable[Fault]) -> List[Fault]:
        return [fault for fault in dict.fromkeys(faults) if not fault.is_warning
                or fault.code not in self.ignored]

    def _palette(self, path: str, documents: List[Document]) -> Judgement:
        findings, registry = Findings(), leaves.registry()
        specs, faults = stubs(documents, registry)
        registry.extend(specs)
        check_models(documents, registry, findings)
        faults += [
            fault for fault in findings.warnings if fault.code != rules.PALETTE_UNKNOWN_NODE.code]
        palette = documents[-1].root.children[0]
        if not palette.children:
            faults.append(palette.fault(rules.PALETTE_EMPTY, "the palette has no node types",
                                        "Groot2 writes them with Export Models"))
        return Judgement(path, self._reported(faults), palette=len(list(models(documents))))

    def _mission(self, path: str, documents: List[Document], palettes: List[Document],
                 main: Optional[str], taken: Set[str]) -> Judgement:
        registry = leaves.registry()
        specs, faults = stubs(documents + palettes, registry)
        used = set(used_types(documents))
        theirs = tuple(spec.id for spec in specs if spec.id in registry)
        for node_id in theirs:
            del registry[node_id]
        lacking = tuple(spec.id for spec in specs if spec.id in used)
        registry.extend(specs)
        judgement = Judgement(path, stubs=lacking, others=theirs,
                              mains=_main_trees(documents, main, taken))
        of_robot: List[Fault] = []  # in the files with what it knows and says in this mission
        known = self._known(folders.mission_name(path), of_robot)
        for tree_id in judgement.mains or (main,):
            tree = attempt(lambda: build_tree(documents, tree_id, registry=registry), faults)
            if tree is None:
                continue
            judgement.nodes += len(tree.nodes)
            faults += tree.warnings
            if not lacking:
                faults += on_robot(tree, self._settings, known)
        if not lacking and judgement.nodes:
            faults += [fault for fault in of_robot if fault.file not in self._configuration]
        faults = _without_used(faults, documents[-1], taken.union(judgement.mains))
        judgement.faults = sorted(self._reported(faults), key=by_place)
        return judgement


def named(path: str) -> str:
    """Return the path of the mission that has this name; a path is returned itself. Raises
    ConfigurationError."""
    if os.path.lexists(path) or os.sep in path or path.endswith(ENDINGS):
        return path
    return find(path)


def expanded(path: str) -> List[str]:
    """Return a file itself; for a folder, the missions, projects and palettes in it and its
    folders.

    A folder without any is returned itself: it cannot be read as a mission.
    """
    return [file
            for file in listed(path) if os.path.isdir(path) and may_be_a_mission(file)] or [path]


def listed(path: str) -> List[str]:
    """Return a file itself; for a folder, the files in it and its folders that may be missions by
    their names."""
    if not os.path.isdir(path):
        return [path]
    paths = []
    for folder, inner, names in os.walk(path):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        paths += [os.path.join(folder, name) for name in sorted(names) if name.endswith(ENDINGS)]
    return paths


def may_be_a_mission(path: str) -> bool:
    """Return whether the file has an element of a mission, or cannot be read."""
    try:
        return bool(_PERHAPS_MISSION.search(read_text(path)))
    except Unreadable:
        return True


def _trees(documents: Iterable[Document]) -> Dict[str, List[str]]:
    """Return the trees of ``documents``, and the trees that each calls."""
    return {tree.attributes.get("ID", ""): [call.attributes.get("ID", "") for call in tree.below
                                            if call.tag == "SubTree"] for document in documents
            for tree in document.root.children if tree.tag == "BehaviorTree"}


def _watched(documents: List[Document], in_folder: bool) -> Iterator[str]:
    """Yield the files of a mission, those that it includes in vain, and those beside it if it may
    take their trees."""
    for document in documents:
        yield document.file
        for element in document.root.children:
            if document.faults and element.tag == "include":
                with contextlib.suppress(MissionError):
                    yield included_path(element)
    if in_folder:
        yield from listed(os.path.dirname(documents[-1].file) or ".")


def _main_trees(documents: List[Document], main: Optional[str],
                taken: Set[str]) -> Tuple[str, ...]:
    """Return the trees of a project, or of a file of which others take trees, that are neither
    called nor taken, if nothing says which of several is the main tree."""
    root = documents[-1].root
    kinds = {child.tag for child in root.children}
    is_project = "include" in kinds and "BehaviorTree" not in kinds
    if main or not (is_project or taken) or "main_tree_to_execute" in root.attributes:
        return ()
    trees = _trees(documents)
    called = taken.union(*trees.values())
    own = trees if is_project else _trees(documents[-1:])
    return tuple(tree_id for tree_id in own if tree_id not in called)


def _parts(read_ones: Dict[str, List[Document]]) -> Dict[str, str]:
    """Return the files that another of them includes, and which."""
    included = {path: {os.path.realpath(document.file) for document in documents[:-1]}
                for path, documents in read_ones.items()}
    # files that include each other are both judged: each reports the circle
    return {path: owner for owner in reversed(list(included)) for path in included
            if os.path.realpath(path) in included[owner]
            and os.path.realpath(owner) not in included[path]}


def _completed(documents: List[Document]) -> List[Document]:
    """Return ``documents``, preceded by the trees that they lack of the files in the last one's
    folder."""
    known, file = _trees(documents), documents[-1].file
    lacking = [(call, file) for calls in known.values() for call in calls if call not in known]
    if not lacking:
        return documents
    paths = {os.path.realpath(document.file) for document in documents}
    others: Dict[str, Document] = {}
    for path in expanded(os.path.dirname(file) or "."):
        if os.path.realpath(path) not in paths:
            with contextlib.suppress(MissionError):  # reported when the file is judged itself
                others[path] = read(path)
    trees = {path: _trees([document]) for path, document in others.items()}
    taken: Dict[str, str] = {}  # with the file that has it: that of the tree that calls it first
    for tree_id, caller in lacking:
        path = next((path for path in (caller, *trees) if tree_id in trees.get(path, ())), "")
        if path and tree_id not in taken:
            taken[tree_id] = path
            lacking += [(call, path) for call in trees[path][tree_id] if call not in known]
    for path, helper in others.items():
        helper.root.children = [
            child for child in helper.root.children if child.tag == "TreeNodesModel"
            or child.tag == "BehaviorTree" and taken.get(child.attributes.get("ID", "")) == path]
    return [others[path] for path in others if path in taken.values()] + documents


def _taken(missions: Dict[str, List[Document]],
           whole: Dict[str, List[Document]]) -> Dict[str, Set[str]]:
    """Return the trees of each file that others take from it without including it."""
    taken: Dict[str, Set[str]] = {os.path.realpath(path): set() for path in missions}
    for path, documents in whole.items():
        for helper in documents[:len(documents) - len(missions[path])]:
            taken.setdefault(os.path.realpath(helper.file), set()).update(_trees([helper]))
    return {path: taken[os.path.realpath(path)] for path in missions}


def _is_taken(document: Document, taken: Set[str]) -> bool:
    """Return whether a file consists of trees that others take, and is no mission of its own."""
    is_mission = "main_tree_to_execute" in document.root.attributes
    return not is_mission and taken.issuperset(_trees([document]))


def _without_used(faults: List[Fault], document: Document, used: Set[str]) -> List[Fault]:
    """Return ``faults`` without those which say that a tree in ``used`` is not used."""
    places = [(document.file, *tree.place(), rules.TREE_UNUSED.code)
              for tree in document.root.children if tree.attributes.get("ID") in used]
    return [fault for fault in faults
            if (fault.file, fault.line, fault.column, fault.code) not in places]


def as_json(fault: Fault) -> Dict[str, object]:
    """Return a fault in the form of ``--json`` (docs/faults.md)."""
    place = None
    if fault.line:
        place = {"start": {"line": fault.line, "column": fault.column},
                 "end": {"line": fault.end_line or fault.line,
                         "column": fault.end_column or fault.column}}
    return {"file": fault.file, "range": place, "severity": "warning" if fault.is_warning
            else "error", "code": fault.code, "text": fault.text, "hint": fault.hint}
